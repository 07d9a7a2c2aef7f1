"""Where the hold `model` of a mechanism at the graphics rate gains less than it can."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from hapticlink.analysis.findings.tracking import table_of
from hapticlink.orchestrator.base.signal_names import CONTROLLER, MECHANISM, MOBILITIES
from hapticlink.orchestrator.results.numbers import short
from hapticlink.orchestrator.results.read_results import Results
from hapticlink.orchestrator.results.run_record import RunRecord

STIFF = 1.5
"""k lambda H^2 of a hand of stiffness k on the mobility lambda, with frames of H, from which on
firmer gains than soft ones keep the limits less often (results/model)."""

COMPENSATION = f"{MECHANISM}.a_bias -> {CONTROLLER}.a_bias"
"""The connection by which velocity terms are compensated."""


def describe_computing_times(record: RunRecord) -> Iterator[str]:
    """A line for each FMU of a run in real time whose early step took longer, in the mean, than its
    result is taken for: its computing time, or, without one, a haptic period."""
    if not record.real_time:
        return
    told: dict[str, float] = {}
    for name in (name for name, hold in record.holds.items() if hold == "ahead"):
        latency = record.latencies.get(name)
        source = name.partition(".")[0]
        told[source] = max(told.get(source, 0.0), latency.min if latency else 0.0)
    for fmu, after in told.items():
        steps = record.calls[fmu].get("step", 0) / record.substeps.get(fmu, 1)
        took = record.timings.steps.get(fmu, 0.0) / max(steps, 1.0)
        if took > (after or record.real_time["period"]):
            counts = f"after {short(1e3 * after)} ms" if after else "at once"
            shortest = record.clocks[record.fmus[fmu].rate].shortest
            key = float(f"{1.5 * took:.1g}")
            remedy = f"computing_time = {key:g}" if key <= shortest else "a lower graphics rate"
            yield (
                f"warning: a step of {fmu} took {short(1e3 * took)} ms in the mean, and its result "
                f"counts as there {counts}: take {remedy}"
            )


def describe_premises(results: Results) -> Iterator[str]:
    """A line for each setting of a run with early steps in which its hold gains less."""
    record = results.record
    if "ahead" not in record.holds.values():
        return
    scene, less = record.scene, "hold = 'model' gains less here:"
    if scene["sensing"] == "encoders":
        observer = (scene["device"] or {}).get("observer", {})
        better = "; device.observer.law = 'kalman' follows it faster (results/observer)"
        yield (
            f"{less} with encoders the observer's estimate of the hand's wrench decides"
            f"{better if observer.get('law') == 'nicosia' else ''}"
        )
    if scene["controller"] and COMPENSATION not in record.connections:
        yield (
            f"{less} without Coriolis and centrifugal compensation the handle moves otherwise "
            "than the mechanism, whatever is held: take controller.bias = 'full'"
        )
    if (share := stiffness_of_frame(results)) >= STIFF:
        yield (
            f"{less} the hand's stiffness is sampled once a frame, and k lambda H^2 is "
            f"{short(share)}, where {STIFF:g} is much: take a higher graphics rate, or soft gains"
        )


def stiffness_of_frame(results: Results) -> float:
    """k lambda H^2 of the hand's stiffness k on the mechanism's mobility lambda, the largest
    eigenvalue of k^(1/2) Lambda^-1 k^(1/2) of the median over the run, times the square of its
    longest frame; 0 where they are not known."""
    record = results.record
    k = np.atleast_1d((record.scene["hand"] or {}).get("stiffness") or 0.0)
    table = table_of(results, MOBILITIES[1])
    if not k.any() or table is None or not len(table["time"]):
        return 0.0
    frame = record.clocks[record.fmus[MECHANISM].rate].longest
    mobility = np.median(table[MOBILITIES[1]], axis=0).reshape(len(k), len(k))
    root = np.sqrt(np.diag(k))
    return float(np.linalg.eigvalsh(root @ mobility @ root)[-1]) * frame**2
