"""The section of an oddity study."""
