"""The section of a preference study."""
