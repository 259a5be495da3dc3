"""Methods of making a transition: points, length and make, each a registry of members."""
