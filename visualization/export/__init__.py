"""Results in the files of other tools."""
