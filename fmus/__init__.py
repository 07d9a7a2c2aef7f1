"""How a component becomes an FMU, and how that FMU is checked."""
