"""What encoders and observer cost at 10 to 60 Hz, beside the same experiment sensed ideally: error,
energy at the user's port, and operations."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from hapticlink.analysis.findings.measures import Measures
from hapticlink.analysis.findings.tracking import tracking
from studies import draw
from studies.report import measures
from studies.report.report_page import Entry, Runs, premises
from studies.report.systems import IDEAL_6, STATED_6, System

RATES = (10, 20, 30, 45, 60)
BIAS = {"none": "o-", "full": "^--"}
SYSTEMS = ((STATED_6, "as stated", draw.ORANGE), (IDEAL_6, "idealised", draw.BLUE))


def entries(runs: Runs, folder: Path) -> Iterator[Entry]:
    figure, (errors, energies) = draw.panels(2)
    largest: dict[tuple[str, str], list[float]] = {}
    for system, name, colour in SYSTEMS:
        for bias, style in BIAS.items():
            found = [_measured(runs, system, bias, rate) for rate in RATES]
            largest[name, bias] = [error for error, _ in found]
            label = f"{name}, bias {bias}"
            errors.loglog(RATES, largest[name, bias], style, color=colour, label=label)
            energies.semilogx(RATES, [peak for _, peak in found], style, color=colour)
    for axis, label in ((errors, "largest |x_S - x_D| (mm)"), (energies, "generated, peak (mJ)")):
        axis.set(xlabel="graphics rate (Hz)", ylabel=label)
        axis.set_xticks(RATES, [str(rate) for rate in RATES], minor=False)
        axis.minorticks_off()
    errors.legend(fontsize="small")
    stated, ideal = largest["as stated", "full"], largest["idealised", "full"]
    ratios = (f"{of[0] / of[-1]:.2g} times as much" for of in (stated, ideal))
    title = f"bias full: {next(ratios)} at {RATES[0]} as at {RATES[-1]} Hz, ideally {next(ratios)}"
    errors.set_title(title, fontsize="medium")
    energies.set_title("energy at the user's port", fontsize="medium")
    operations = [measures.operations(system.scene, *system.options) for system, *_ in SYSTEMS]
    yield Entry(
        "Section 4.2.1, what encoders and observer cost",
        f"{stated[0]:.2g} mm at {RATES[0]} Hz and {stated[-1]:.2g} mm at {RATES[-1]} Hz with them, "
        f"{ideal[0]:.2g} and {ideal[-1]:.2g} mm without",
        draw.save(figure, folder, "cost_of_sensing.png"),
        "not discussed",
        "with Coriolis compensation the largest distances are "
        f"{_listed(stated)} mm with encoders and observer and {_listed(ideal)} mm without, at "
        f"{', '.join(map(str, RATES))} Hz; without it, as in the report, "
        f"{_listed(largest['as stated', 'none'])} and {_listed(largest['idealised', 'none'])} mm. "
        f"A haptic tick takes {operations[0]:.0f} operations with them and {operations[1]:.0f} "
        "without",
        [premises(name, system.run(runs)) for system, name, _ in SYSTEMS],
        "; ".join(
            system.command("controller.bias=full", f"graphics.rate={RATES[0]}")
            for system, *_ in SYSTEMS
        ),
    )


def _measured(runs: Runs, system: System, bias: str, rate: int) -> tuple[float, float]:
    """The largest distance of handle and operational point (mm), and the largest energy generated
    at the user's port (mJ)."""
    results = system.run(runs, f"controller.bias={bias}", f"graphics.rate={rate}")
    port = Measures(results).port
    assert port is not None
    return float(tracking(results)[1].max()), 1e3 * port.peak


def _listed(values: list[float]) -> str:
    return ", ".join(f"{value:.2g}" for value in values)
