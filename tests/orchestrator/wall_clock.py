"""A wall clock for tests of runs in real time: it goes on only while somebody waits for it."""

from collections.abc import Callable, Mapping
from types import MappingProxyType

from hapticlink.orchestrator.run.concurrent_fmus import Job
from hapticlink.orchestrator.run.real_time import RealTimeRun

MS = 1_000_000


class WallClock:
    """computing: how long the k-th step beside the loop takes (ns), None for ever. late: by how
    much (ns) the first wait that ends after a time (ns) ends too late."""

    def __init__(
        self,
        computing: Callable[[int], int | None] = lambda k: 0,
        late: Mapping[int, int] = MappingProxyType({}),
    ) -> None:
        self.time = 0
        self._computing, self._late, self._steps = computing, dict(late), 0
        self._left: list[tuple[int, Job]] = []

    def __call__(self) -> int:
        now, left, self._left = self.time, self._left, []
        for self.time, done in (row for row in left if row[0] <= now):
            done()
        self._left, self.time = [row for row in left if row[0] > now], now
        return now

    def wait(self, until: int) -> None:
        self.time = max(self.time, until)
        for at in [at for at in self._late if at <= self.time]:
            self.time += self._late.pop(at)

    def submit(self, job: Job, done: Job) -> None:
        """As a worker: the step is taken at once, and is done after its time."""
        takes = self._computing(self._steps)
        self._steps += 1
        job()
        if takes is not None:
            self._left.append((self.time + takes, done))

    def close(self, seconds: float) -> bool:
        return True

    def run(self, turn: Callable[..., object] | None = None, speed: float = 1.0) -> RealTimeRun:
        """What a run takes to be paced by this clock."""
        return RealTimeRun(turn, self, self.wait, lambda clock: self, speed)
