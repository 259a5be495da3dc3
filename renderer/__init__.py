"""Skeletal motion drawn offscreen: joint positions in, frames and videos out. Imports nothing of study."""
