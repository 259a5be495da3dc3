"""The player: a participant's session in a window. `loop.play` walks the session; the window is an argument."""
