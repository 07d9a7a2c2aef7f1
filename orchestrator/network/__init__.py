"""FMUs that are served from another computer, and the run that steps them from here."""
