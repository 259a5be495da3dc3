"""A protocol becomes a plan, stimuli, sessions and responses."""
