"""The section of a rating study."""
