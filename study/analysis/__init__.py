"""Responses in, estimates out: pure functions."""
