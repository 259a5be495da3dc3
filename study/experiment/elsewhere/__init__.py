"""Sessions in other programs: films and trials go out to them, their answers come back into a results folder."""
