"""Which operation comes when: the plan of a run, as data."""
