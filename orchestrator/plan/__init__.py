"""The plan of a run as data: which operation is executed at which event."""
