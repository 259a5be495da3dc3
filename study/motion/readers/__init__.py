"""Motion files to clips and back: one reader a format, found by suffix."""
