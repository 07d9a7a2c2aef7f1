"""The base units of every signal, in the order in which FMI and SSP list their exponents."""

BASES = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")
