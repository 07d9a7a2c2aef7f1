"""A plan carried out: FMUs called, samples held, rows recorded."""
