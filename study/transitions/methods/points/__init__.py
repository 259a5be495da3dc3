"""Where a transition stands."""
