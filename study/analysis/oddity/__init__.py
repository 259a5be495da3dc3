"""Analysis of oddity tasks."""
