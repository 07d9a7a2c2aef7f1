"""The statuses that functions of an FMU return (FMI 2.0.5 section 2.1.3, FMI 3.0 section 2.2.3)."""

STATUS = ("ok", "warning", "discard", "error", "fatal", "pending")
WARNING, DISCARD, ERROR, FATAL = 1, 2, 3, 4
