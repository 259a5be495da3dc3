"""Two clips and a method in, one clip out."""
