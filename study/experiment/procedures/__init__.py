"""Procedures: which trial comes next, given the answers so far."""
