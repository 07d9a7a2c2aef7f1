"""What FMUs in the process of a run may do to it, and how it is undone."""
