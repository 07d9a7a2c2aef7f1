"""FMUs, connections, clocks and holds: what is simulated."""
