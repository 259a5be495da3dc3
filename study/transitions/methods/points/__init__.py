"""Where a transition is placed: the points."""
