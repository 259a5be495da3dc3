"""How the frames of a transition are made."""
