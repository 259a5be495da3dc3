"""Motions and their transitions for game engines."""
