"""The section of a same-different study."""
