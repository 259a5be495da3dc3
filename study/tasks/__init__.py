"""Tasks: what a participant decides, one module a task."""
