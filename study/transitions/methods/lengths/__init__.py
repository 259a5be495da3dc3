"""How long a blend takes."""
