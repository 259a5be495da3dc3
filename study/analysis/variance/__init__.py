"""Analysis of variance and effect sizes."""
