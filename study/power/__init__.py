"""A protocol and effects in, the participants needed out."""
