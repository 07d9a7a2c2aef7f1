"""What a rollback restores."""

from __future__ import annotations

from copy import deepcopy
from typing import Any


class Restorable:
    """An object whose whole state is in its attributes. deepcopy leaves functions as they are, so
    that the constant context of a hold is not copied."""

    def saved(self) -> Any:
        """A copy of the state, for `restore`."""
        return deepcopy(vars(self))

    def restore(self, saved: Any) -> None:
        """Return to a state that `saved` gave; it can be restored again."""
        vars(self).update(deepcopy(saved))
