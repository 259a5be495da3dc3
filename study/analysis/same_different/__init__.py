"""Same-different studies: thresholds and sensitivity."""
