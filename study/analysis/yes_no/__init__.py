"""Analysis of yes-no studies."""
