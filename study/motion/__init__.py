"""Motion files and synthetic motions, as one type: Clip."""
