"""The results of a run in Python."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from textwrap import shorten
from typing import TYPE_CHECKING, Any

from hapticlink.analysis.findings import summary
from hapticlink.analysis.findings.measures import Measures
from hapticlink.analysis.findings.tracking import Tracking, pose_error
from hapticlink.fmus.versions import install_command
from hapticlink.orchestrator.base.errors import InputFault, unknown
from hapticlink.orchestrator.results.read_results import Results, Table, Vector

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


@dataclass(frozen=True, repr=False, eq=False)
class Run(Results):
    """The results of a run, whether it failed or not.

    `r["haptics"]` is the Table of a rate, `r["virtual_mechanism.x"]` a signal as a NumPy array:
    (k,) of a scalar, (k, n) of a vector, (k, n, m) of a matrix, in the units of its FMU. Rates
    differ, so that each signal has its own k times: `r.time("virtual_mechanism.x")`, in s.

    `print(r)` gives the lines of `hapticlink run`; in a notebook a run shows them with its
    mechanism. `tables` are the Tables by rate, `run` is the content of run.json (the scene,
    versions, holds, energies, ages of samples, timings), `folder` is the result folder, None for a
    run in memory. `numbers` are those of its lines, None of one that was loaded.
    """

    numbers: tuple[str, ...] | None = None

    def __getitem__(self, name: str) -> Any:
        """The Table of a rate, or a signal of any rate. Raises KeyError with a hint for an unknown
        name."""
        return self.tables[name] if name in self.tables else self._table(name)[name]

    def __contains__(self, name: object) -> bool:
        return name in self.tables or any(name in table for table in self.tables.values())

    def __iter__(self) -> Iterator[str]:
        return iter(self.tables)

    def time(self, name: str) -> Vector:
        """The times (s) of a signal, or of a rate's rows. Raises KeyError for an unknown name."""
        table: Table = self.tables[name] if name in self.tables else self._table(name)
        return table["time"]

    def frame(self, rate: str | None = None) -> pd.DataFrame:
        """The Table of a rate, by default of the only one, as a pandas frame with the index `time`
        (s), a column per scalar. Raises InputFault if pandas is not installed, KeyError for an
        unknown rate, and without one where there are several."""
        if rate is None and len(self.tables) != 1:
            raise KeyError(f"name one of the rates: {', '.join(self.tables)}")
        name = next(iter(self.tables)) if rate is None else rate
        if name not in self.tables:
            raise KeyError(unknown("rate", name, self.tables))
        return frame(self.tables[name], "time")

    @property
    def fault(self) -> str | None:
        """The message of the fault that ended the run, such as an FMU's error or a crash; None if
        it ended regularly, also by `stop_when` or at the limit of the device's workspace."""
        return self.record.fault.message if self.record.fault else None

    def measures(self, until: float = math.inf) -> Measures:
        """The numbers of a run: `tracking`, largest and root mean square by user; `forces`, the
        largest of each wrench (N); `motors`, the largest share of their torque limit; `closure_m`;
        `constrained`, the numbers of constrained directions; `folded`, frames with a folded
        graphics copy; `port`, the energy at the user's port (J); `held`, the energy of each hold
        (J); `held_contacts`, what new frames of contacts did; `noticed`, what a hand would notice,
        by user. Those of paths, forces and torques are until a time (s), the others of the whole
        run.
        """
        return Measures(self, until)

    def tracking(self) -> Tracking:
        """Tracking error `(time_s, distance_mm, angle_rad)`: |x_S - x_D| and |theta_S - theta_D|
        between operational point and handle at times (s). Raises KeyError if the scene does not
        have both."""
        return pose_error(self)

    def figures(self) -> dict[str, Figure]:
        """Matplotlib figures by name, as far as the scene has the signals: `mechanism`, or
        `trajectories` without a linkage in the plane, `distance`, `forces`, `contact`,
        `constraints`, `user_port`, `real_time`."""
        from hapticlink.visualization.figures import run_figures  # with casadi, slow to load

        return run_figures.figures(self)

    def _table(self, name: str) -> Table:
        found = next((table for table in self.tables.values() if name in table), None)
        if found is None or name == "time":
            signals = [s for table in self.tables.values() for s in table.signals if s != "time"]
            raise KeyError(unknown("rate or signal", name, [*self.tables, *signals]))
        return found

    def __str__(self) -> str:
        ending, *lines = summary.print_lines(self, self.run["scene"]["title"], self.numbers)
        return "\n".join([ending, *([f"  {self.fault}"] if self.fault else []), *lines])

    def _repr_html_(self) -> str:
        from hapticlink.visualization.compare import page  # with Matplotlib, slow to load

        return page.opening({self.run["scene"]["title"]: self}, "h3")

    def __repr__(self) -> str:
        lines = [f"{self.run['scene']['title']}: {summary.ending(self)}"]
        lines += [self.fault] if self.fault else []
        lines += [f"{rate}: {shorten(repr(t), 88)}" for rate, t in self.tables.items()]
        return "\n  ".join([*lines, f"folder: {self.folder or 'none, in memory'}"])


def frame(columns: Mapping[str, Any], index: str | None = None) -> pd.DataFrame:
    """A frame of `columns` whose index is the column `index`. Raises InputFault if pandas is not
    installed."""
    try:
        import pandas as pd
    except ImportError:
        raise InputFault(f"frame() needs pandas: {install_command('pandas')}") from None
    made = pd.DataFrame(dict(columns))
    return made.set_index(index) if index else made
