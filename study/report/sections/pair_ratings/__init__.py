"""The section of a study that rates pairs."""
