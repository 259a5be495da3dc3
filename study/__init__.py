"""Segue: perceptual studies of motion transitions (motion, transitions, experiment, analysis, report, apps)."""

__version__ = "0.1.0"
