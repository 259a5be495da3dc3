"""Psychometric functions: likelihood, posterior, thresholds."""
