"""Estimates become figures, tables and one self-contained page."""
