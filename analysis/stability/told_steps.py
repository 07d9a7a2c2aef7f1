"""What a verdict is at, told as it goes on."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[str, int, int], object]
"""What is judged, and the numbers of finished and of all steps."""


class Steps:
    """Tells `progress` what is begun, of a number of steps that are `expected`. found: what is
    known already, told with all that follows."""

    def __init__(self, progress: Progress | None, expected: int) -> None:
        self._progress, self.expected, self._begun = progress, expected, 0
        self.found = ""

    def begin(self, what: str) -> None:
        """Begins the next step."""
        self._begun += 1
        self.tell(what)

    def tell(self, what: str) -> None:
        """Tells what the step that was begun is at."""
        if self._progress:
            text = f"{what} ({self.found})" if self.found else what
            done = max(0, self._begun - 1)
            self._progress(text, done, max(self.expected, self._begun))
