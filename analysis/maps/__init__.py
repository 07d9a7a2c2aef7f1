"""Maps of stability over varied keys."""
