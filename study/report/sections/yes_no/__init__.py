"""The section of a yes-no study."""
