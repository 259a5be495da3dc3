"""Preference studies: tests, models, scales."""
