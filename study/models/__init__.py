"""How observers decide, as pure functions: numbers in, chances out."""
