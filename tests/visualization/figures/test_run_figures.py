"""Figures: their titles, and the signals that they draw."""

import warnings
from typing import Any

import numpy as np
import pytest

import hapticlink as hl
from hapticlink.analysis.findings.user_port import user_port
from hapticlink.orchestrator.experiment import simulate
from hapticlink.orchestrator.results.read_results import Results
from hapticlink.visualization import figure_axes
from hapticlink.visualization.figures import run_figures, sweep_figure
from hapticlink.visualization.figures.force_figure import forces
from tests.shared_fixtures import run_once


@pytest.mark.parametrize(
    ("value", "text"),
    [(160.4, "160"), (1234.6, "1230"), (0.0421, "0.0421"), (0.0, "0"), (2.0, "2"),
     (3.21e-9, "3.21e-09")],
)  # fmt: skip
def test_numbers_are_three_digits_without_powers_of_ten(value: float, text: str) -> None:
    assert figure_axes.short(value) == text


def drawn(results: Results) -> dict[str, Any]:
    """The axes of each figure, by its name."""
    return {name: figure.axes[0] for name, figure in run_figures.figures(results).items()}


def test_an_early_end_stands_in_every_title() -> None:
    found = drawn(run_once("closed-loop-ideal", ["stop_when='virtual_mechanism.x[1]<0.044'"]))
    assert {*found} == {
        "mechanism",
        "distance",
        "forces",
        "constraints",
        "user_port",
    }
    for axes in found.values():
        assert "until stop_when ended the run at 0." in axes.get_title().replace("\n", " ")
    names = [line.get_label() for line in found["mechanism"].lines]
    assert {"path of operational point x_S", "path of handle x_D", "operational point"} <= {*names}


def test_the_drawing_says_what_happened_and_shows_the_device_whole() -> None:
    """The numbers are those of the tables; the arrow points along the wrench of the hand."""
    options = "graphics.rate=10", "controller.topology=false"
    found = run_once("closed-loop-ideal", options)
    figure = run_figures.figures(found)["mechanism"]
    axes, whole = figure.axes
    x = found.haptics["virtual_mechanism.x"][:, :2] * 1e3
    gap = np.linalg.norm(x - found.haptics["haptic_device.x_true"][:, :2] * 1e3, axis=1)
    title = " ".join(axes.get_title().split())
    assert f"operational point up to {np.linalg.norm(x - x[0], axis=1).max():.3g} mm" in title
    assert title.startswith(f"Tracking error up to {gap.max():.3g} mm, at ")
    assert title.endswith("until the device left its workspace at 2.08 s")
    (arrow,) = (text for text in axes.texts if text.arrow_patch)
    assert arrow.xyann == pytest.approx((-run_figures.ARROW, 0.0))
    device = hl.scene("closed-loop-ideal").device
    assert device
    arms = [line for line in whole.lines if line.get_label() == "arms of the device"]
    assert arms
    (low, high), drawn_y = whole.get_ylim(), [axes.get_ylim()]
    bases = [1e3 * motor.joint.at_parent[1] for motor in device.motors]
    assert low < min(bases) < max(bases) < high
    assert min(y for y, _ in drawn_y) > min(bases)


def test_the_energy_at_the_port_stands_beside_the_work_of_the_hand() -> None:
    found = run_once("closed-loop-ideal", ["duration=0.6"])
    axes = drawn(found)["user_port"]
    curves = {line.get_label(): line.get_ydata() for line in axes.lines}
    F, pose = found.haptics["hand.F"], found.haptics["haptic_device.x_true"]
    work = 1e3 * np.cumsum((F[:-1] * np.diff(pose, axis=0)).sum(axis=1))
    assert curves["put in by the hand"][1:] == pytest.approx(work, rel=1e-9)
    at = int(curves["generated in all"].argmax())
    said = f"the hand had put in {curves['put in by the hand'][at]:.3g} mJ"
    assert said in " ".join(axes.get_title().split())
    low, high = axes.get_ylim()
    assert low <= min(map(np.min, curves.values()))
    assert high >= max(map(np.max, curves.values()))


def test_a_rendering_that_dissipates_is_not_said_to_generate_nothing_at_most() -> None:
    """A port whose energy falls from the start on."""
    found = run_once("closed-loop-ideal", ["duration=0.6"])
    port = user_port(found)
    assert port
    falls = port._replace(generated_J=-np.linspace(0.0, 0.0269, len(port.time_s)))
    figure = run_figures._port(found, falls)
    said = " ".join(figure.axes[0].get_title().split())
    assert said.startswith("The rendering generated no energy and dissipated 26.9 mJ")
    assert "at most" not in said


def test_obstacles_and_the_force_of_contacts_are_drawn() -> None:
    found = run_once("obstacles", ["duration=0.7"])
    axes = drawn(found)
    patches = axes["mechanism"].patches
    assert [type(p).__name__ for p in patches][:3] == ["Circle", "Circle", "Polygon"]
    assert patches[0].center == pytest.approx((72, 12))  # mm, of the disc `pin`
    assert patches[0].radius == pytest.approx(8)
    force = axes["contact"].lines[0].get_ydata()
    F = found.haptics["virtual_mechanism.F_env"]
    assert force == pytest.approx((F[:, 0] ** 2 + F[:, 1] ** 2) ** 0.5)
    assert force.max() > 0
    enclosed = drawn(run_once("enclosure", ["duration=0.2"]))
    (walls,) = (line for line in enclosed["mechanism"].lines if line.get_label() == "enclosure")
    assert walls.get_xydata().min(axis=0) == pytest.approx((-30, -45))


def test_every_hand_s_point_is_drawn() -> None:
    found = run_once("two-hands", ["duration=0.5"])
    (left,) = (x for x in drawn(found)["mechanism"].lines if x.get_label() == "path of point left")
    expected = found.haptics["virtual_mechanism.left.x"][:, 0] * 1e3
    assert left.get_xdata() == pytest.approx(expected)


def test_both_users_are_drawn_and_their_works_are_told() -> None:
    """A held force times the displacement of the step over which it acts."""
    found = run_once("two-users", ["duration=0.5"])
    axes, r = drawn(found), found.haptics
    apart = (r["virtual_mechanism.left.x"] - r["haptic_device_left.x_true"])[:, :2] * 1e3
    assert axes["distance"].lines[1].get_ydata() == pytest.approx(np.hypot(*apart.T), abs=1e-12)
    curves = {line.get_label(): line.get_ydata() for line in axes["forces"].lines}
    F, x = r["hand_left.F"], r["haptic_device_left.x_true"]
    assert curves["left: hand, F_hand"] == pytest.approx(np.hypot(*F[:, :2].T))
    work = float((F[:-1] * np.diff(x, axis=0)).sum())
    port = user_port(found)
    assert port
    assert port.works["left: hand"] == pytest.approx(work, rel=1e-9)


def test_both_users_forces_are_drawn_where_a_system_describes_no_device() -> None:
    """As that of an SSP, which has the blocks and not their descriptions."""
    found = run_once("two-users", ["duration=0.1"])
    styles = {line.get_linestyle() for line in forces(found, {}).axes[0].get_lines()}
    assert styles == {"-", "--"}


def test_runs_that_differ_in_many_keys_are_named_by_those_they_give() -> None:
    keys = [f"linkage.body.link{n}.mass" for n in range(12)]
    rows = [{key: "2", "tracking_max_mm": 1.0 + n, "end": "duration"} for n, key in enumerate(keys)]
    figure = sweep_figure.draw([*rows, {"tracking_max_mm": 5.0, "end": "duration"}], keys, None)
    assert figure
    with warnings.catch_warnings(action="error"):
        figure.canvas.draw()
    labels = [label.get_text() for label in figure.axes[0].get_yticklabels()]
    assert labels == [*(f"{key}=2" for key in keys), "as in the scene"]
    assert " ".join(figure.axes[0].get_title().split()).endswith("1 mm at mass of link0 = 2 kg")


def test_of_many_draws_the_share_of_runs_is_drawn_with_failed_ones_among_them() -> None:
    values = np.random.default_rng(3).permutation(np.arange(1.0, 181.0))
    rows = [{"w": f"[{v}]", "tracking_max_mm": v, "end": "duration"} for v in values]
    rows += [{"w": f"[{n}]", "end": "fault"} for n in range(20)]
    figure = sweep_figure.draw(rows, ["w"], None)
    assert figure
    (curve,) = figure.axes[0].lines
    x, share = curve.get_data()
    assert [x[0], share[0], x[-1], share[-1]] == [1.0, 0.0, 180.0, 90.0]
    np.testing.assert_allclose(share[1:], [100 * (values <= at).sum() / 200 for at in x[1:]])
    assert curve.get_drawstyle() == "steps-post"
    title = " ".join(figure.axes[0].get_title().split())
    assert title.endswith("; 20 of 200 runs ended early or failed")
    assert sweep_figure.draw([r for r in rows if r["end"] == "fault"], ["w"], None) is None


def test_the_title_of_a_sweep_has_quantity_unit_and_failures() -> None:
    best = {"graphics.rate": "60", "hold": "foh"}
    told = sweep_figure.finding(best, 0.4361, "RMS tracking error (mm)", list(best), 3, 12)
    assert told == (
        "RMS tracking error down to 0.436 mm at graphics rate = 60 Hz, hold = foh; "
        "3 of 12 runs ended early or failed"
    )
    assert sweep_figure.axis("graphics.rate") == "graphics rate (Hz)"
    assert sweep_figure.axis("hold") == "hold"


def test_a_run_without_files_has_the_figures_of_one_in_a_folder(tmp_path) -> None:
    options = {"duration": 0.05}
    kept = hl.run("single-body", options, out=tmp_path, figures=False)
    run = simulate(hl.scene("single-body", options), tmp_path / "rows", in_memory=True, csv=False)
    assert run_figures.figures(run.results).keys() == kept.figures().keys() != set()
