"""How FMUs run together: scenes, rates, holds, coupling, results."""
