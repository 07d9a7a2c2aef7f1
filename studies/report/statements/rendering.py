"""Chapter 4: the control structure that renders the mechanism."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from hapticlink.analysis.findings.tracking import count_folded, tracking
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.results.read_results import Results
from studies.report import appendix_a, chapter4, measures
from studies.report.chapter6 import FULL, LENGTH_SCALE
from studies.report.graphics_copy import PULLED
from studies.report.report_page import Runs, command
from studies.report.statements.experiment import SETTINGS_6, TOPOLOGY
from studies.report.statements.statement import (
    Statement,
    compare,
    leave,
    misprinted,
    test_command,
    tested,
)
from studies.report.systems import IDEAL_6, OFF, ON, STATED_6

INFO = "hapticlink info closed-loop"
CONTROLLER = "pytest tests/components/blocks/test_controller.py::"
WHOLE_LAW = "components/blocks/test_controller.py::test_whole_law"
LAW = test_command(WHOLE_LAW)
COUNTED_TWICE = f"{CONTROLLER}test_device_at_rest_accelerates_like_the_mechanism"
RATES = (10, 30, 60)
FRESH = "graphics.rate=512"
FELT = "virtual_mechanism.F_env -> controller.F_env"


def statements(runs: Runs) -> Iterator[Statement]:
    yield from _structure(runs)
    yield from _device(runs)
    yield from _impedance(runs)
    yield from _simulation(runs)
    yield from _teleoperation(runs)
    yield from _topology(runs)
    yield from _summary(runs)


def inertia_by_rate(runs: Runs) -> dict[int, float]:
    """Distance (mm) of the handle's path from that with matrices at 512 Hz, by graphics rate."""
    fresh = IDEAL_6.run(runs, ON, FRESH).haptics["haptic_device.x_true"]
    found = {}
    for rate in RATES:
        path = IDEAL_6.run(runs, ON, f"graphics.rate={rate}").haptics["haptic_device.x_true"]
        rows = min(len(path), len(fresh))
        found[rate] = 1e3 * float(np.hypot(*(path[:rows] - fresh[:rows])[:, :2].T).max())
    return found


def channel_stiffness(results: Results) -> tuple[float, np.ndarray]:
    """k_j, and the eigenvalues of Lambda^-1 K_pc at the start (1/s2): the stiffness of topology
    controller and of position channels, each per inertia that it accelerates."""
    controller = results.record.scene["controller"]
    law, coupling = controller["topology"], controller["teleoperation"]
    k_j = 200.0 if law is True else float(law["stiffness"])
    mobility = results.haptics["virtual_mechanism.Lambda_inv"][0]
    values = np.linalg.eigvals(mobility @ np.diag(coupling["stiffness"])).real
    return k_j, np.sort(values)[::-1]


def are_connected(results: Results, *names: str) -> bool:
    """Whether a run has these connections."""
    return {*names} <= {*results.record.connections}


def _touching(runs: Runs) -> Results:
    """A run with contacts, as stated."""
    return runs("enclosure", *chapter4.STATED, chapter4.SHOWN)


def _drifts(runs: Runs) -> tuple[float, float]:
    """The largest distance (mm) of handle and operational point with the coupling, and without."""
    both = STATED_6.run(runs, ON), STATED_6.run(runs, ON, "controller.teleoperation=false")
    held, loose = (float(tracking(results)[1].max()) for results in both)
    return held, loose


def _structure(runs: Runs) -> Iterator[Statement]:
    results = STATED_6.run(runs, ON)
    blocks = {"haptic_device", "virtual_mechanism", "virtual_environment", "controller"}
    linkages = [open_scene.load(name).linkage for name in ("single-body", "serial")]
    sizes = [len(linkage.body) for linkage in linkages if linkage and not linkage.loop]
    yield compare(
        "4.1",
        "users can touch single objects and serial linkages today",
        len(sizes) == 2 and sizes[0] == 1 < sizes[1],
        f"scenes `single-body` and `serial`, which has {sizes[-1]} bodies and no closure",
        command("serial", "duration=0.1"),
    )
    yield compare(
        "4.2; figure 4.1",
        "device, simulation, four-channel and topology controller are the blocks",
        blocks <= {*results.record.fmus},
        f"FMUs: {', '.join(sorted(blocks))}; both controllers are one FMU, and the hand is another",
        INFO,
    )
    pairs = {name.split(" -> ")[0].split(".")[1] for name in results.record.connections}
    yield compare(
        "4.2; figure 4.1",
        "forces go both ways between the blocks, positions one way",
        {"F_drift", "x"} <= pairs,
        "F_drift acts on the device as + and on the mechanism "
        "as -; poses go from device and mechanism to the controller",
        INFO,
    )


def _device(runs: Runs) -> Iterator[Statement]:
    results = STATED_6.run(runs, ON)
    haptics, scene = results.haptics, results.record.scene
    shown = STATED_6.command(ON)
    yield compare(
        "4.2.1",
        "the device gets F_h, F_drift, F_env and F_T, and gives x_D and F_h",
        "haptic_device.F_hand_observed[1]" in haptics,
        "F_motor carries the last three; x, v and F_hand_observed come back",
        INFO,
    )
    yield tested(
        "4.2.1; figure 4.2",
        "the handle moves in the plane and turns without limit",
        "theta stays continuous over many turns",
        "components/blocks/test_haptic_device.py::test_theta_is_continuous_over_many_turns",
    )
    yield tested(
        "4.2.1; figure 4.2",
        "two pantographs in parallel planes carry the ends of a crank",
        "links close on the crank's ends at any pose",
        "components/device/test_pantograph.py::"
        "test_links_close_on_the_crank_ends_with_elbows_outward",
    )
    yield tested(
        "4.2.1",
        "two motors at the base joints drive each pantograph, as torque sources",
        f"four torques, limited to {scene['device']['motor']['torque_limit']} N.m (assumed)",
        "components/device/test_pantograph.py",
    )
    degrees = np.degrees(scene["device"]["encoder"]["resolution"])
    yield compare(
        "4.2.1",
        "encoders at the base joints resolve 0.09 degrees",
        abs(degrees - 0.09) < 1e-12,
        f"{degrees:.3g} degrees, {360 / degrees:.0f} counts a turn",
        SETTINGS_6,
    )
    error = haptics["haptic_device.F_hand_observed"] - haptics["hand.F"]
    late = haptics["time"] > 0.2
    force = float(measures.rms(np.hypot(*error[late, :2].T)))
    yield compare(
        "4.2.1",
        "a Nicosia observer finds velocity and hand force from angles and torques",
        force < 0.5 * 0.5,
        f"after .2 s the observed force is off by {force:.2g} N RMS of 0.5 N (gains assumed)",
        shown,
    )
    yield leave(
        "4.2.1",
        "the observer finds the acceleration, too",
        "the device has no such output; the equations of the observer are not given",
        "pytest tests/components/device/test_observer.py",
    )
    yield leave(
        "4.2.1",
        "shaping the device's impedance simplifies the teleoperation controller",
        "an opinion",
    )


def _impedance(runs: Runs) -> Iterator[Statement]:
    on = IDEAL_6.run(runs, ON)
    error = measures.acceleration_error(on)
    shown = IDEAL_6.command(ON)
    yield tested(
        "4.2.1 (4.1)",
        "Lambda xdd + B_d xd + K_d x = F_HD is what the hand shall feel",
        "the law with B_d and K_d is that of the controller to rounding",
        WHOLE_LAW,
    )
    count = on.haptics["haptic_device.x"].shape[1]
    yield compare("4.2.1 (4.2)", "x_h is (x, y, theta)", count == 3, f"{count} coordinates", LAW)
    yield misprinted(
        "4.2.1 (4.3)",
        "F_HD is the sum of F_h, F_drift, F_env and F_T",
        "F_T stands outside Lambda^-1, which would cancel it along the directions that it "
        "is for, and F_h occurs once",
        LAW,
    )
    yield compare(
        "4.2.1 (4.4)",
        "xdd = Lambda^-1 (F_HD - B_d xd - K_d x)",
        error < 1e-3,
        f"velocities of device and mechanism after one period differ by {error:.0e} of themselves",
        shown,
    )
    yield tested(
        "4.2.1 (4.5)",
        "M_d xdd + C_d xd = F_h + u is the device",
        "held torques against SciPy",
        "components/blocks/test_haptic_device.py::test_held_torques_against_scipy",
    )
    yield misprinted(
        "4.2.1 (4.6)",
        "the control law with (M_d Lambda^-1 - I) F_h + M_d Lambda^-1 F_HD",
        f"F_HD has F_h, too: the device would accelerate 2 times as the mechanism; "
        f"with F_h once to {error:.0e}",
        COUNTED_TWICE,
    )
    values = np.linalg.eigvalsh(on.haptics["virtual_mechanism.Lambda_inv"][0])
    yield compare(
        "4.2.1",
        "Lambda^-1 is zero along directions that the joints resist",
        abs(values[0]) < 1e-9 * values[-1],
        f"smallest eigenvalue {values[0]:.0e} of {values[-1]:.4g}",
        shown,
    )
    gap = {
        name: tracking(system.run(runs, OFF))[1].max()
        for name, system in (("as stated", STATED_6), ("idealised", IDEAL_6))
    }
    said = ", ".join(f"{name} {mm:.0f} mm" for name, mm in gap.items())
    yield compare(
        "4.2.1; 4.2.4",
        "zero acceleration alone does not hold the hand on its constraints",
        min(gap.values()) > 20,
        f"apart without the topology controller: {said}",
        f"{STATED_6.command(OFF)}; {IDEAL_6.command(OFF)}",
    )
    yield compare(
        "4.2.1",
        "numerical drift and the device's limited stiffness are what lets the hand leave its "
        "constraints under impedance control",
        gap["idealised"] < 20,
        f"also without encoders and with ideal motors ({gap['idealised']:.0f} mm): what "
        f"drives them apart is mostly the neglected velocity terms; with these sent "
        f"{tracking(IDEAL_6.run(runs, OFF, FULL))[1].max():.2g} mm",
        f"{IDEAL_6.command(OFF)}; {IDEAL_6.command(OFF, FULL)}",
    )
    yield compare(
        "4.2.1",
        "the impedance controller depends on two systems, the mechanism and the hardware",
        are_connected(
            STATED_6.run(runs, ON),
            "virtual_environment.Lambda_inv -> controller.Lambda_inv",
            "haptic_device.M -> controller.M",
            "haptic_device.c -> controller.c",
        ),
        "Lambda^-1 of the one, M_d and C_d v of the other",
        INFO,
    )
    along, whole = measures.resisted_acceleration(on, LENGTH_SCALE)
    yield compare(
        "4.2.1",
        "the mechanism's acceleration is zero along directions that its joints resist",
        along < 0.01 * whole,
        f"Lambda^-1 F alone is: in motion the acceleration along them is {along:.2g} of "
        f"{whole:.2g} m/s2 RMS (rotation times the mean link length), by velocity terms",
        shown,
    )
    sizes = measures.neglected(on)
    yield compare(
        "4.2.1",
        "(4.6) applies Coriolis and centripetal forces of the mechanism, too, since the device "
        "follows its acceleration",
        sizes.bias[0] < 0.1 * sizes.rendered[0],
        f"(4.4) has no such term: {sizes.bias[0]:.2g} m/s2 RMS are left out, "
        f"{sizes.rendered[0]:.2g} rendered; C_d is that of the device",
        shown,
    )
    yield leave("figure 4.3", "the control structure of the device block", "a drawing", INFO)


def _simulation(runs: Runs) -> Iterator[Statement]:
    results, pulled = STATED_6.run(runs, ON), STATED_6.run(runs, ON, PULLED)
    yield compare(
        "4.2.2",
        "the simulation gets F_h and F_drift, and gives x_S and F_env",
        are_connected(
            _touching(runs),
            "haptic_device.F_hand_observed -> virtual_mechanism.F_hand",
            "controller.F_drift -> virtual_mechanism.F_drift",
            "virtual_mechanism.x -> controller.x_S",
            FELT,
        ),
        "connections of `virtual_mechanism`, of F_env in scene `enclosure`",
        "hapticlink info enclosure",
    )
    yield compare(
        "4.2.2; figure 4.4",
        "the simulation is a haptics and a graphics block that a controller connects",
        {"virtual_mechanism", "virtual_environment"} <= {*results.record.fmus},
        "`virtual_mechanism` at 512 Hz, `virtual_environment` at the graphics rate",
        INFO,
    )
    yield leave(
        "4.2.2",
        "humans feel changes of a force rather than its size and direction",
        "psychophysics, cited from [15]",
    )
    inertia = inertia_by_rate(runs)
    said = ", ".join(f"{mm:.0f} mm at {rate} Hz" for rate, mm in inertia.items())
    yield compare(
        "4.2.2",
        "an inertia that is updated slowly has little influence",
        max(inertia.values()) < 2,
        f"idealised, the handle's path within 3 s is {said} away from that with a copy at 512 Hz",
        "; ".join(IDEAL_6.command(ON, f"graphics.rate={rate}") for rate in (*RATES, 512)),
    )
    yield compare(
        "4.2.2",
        "the mechanism filters changes of its inertia as a second-order system does",
        inertia[60] < inertia[10] / 6,
        f"the deviation falls about with the first power of the "
        f"rate: by {inertia[10] / inertia[60]:.2g} from 10 to 60 Hz",
        "; ".join(IDEAL_6.command(ON, f"graphics.rate={rate}") for rate in (10, 60, 512)),
    )
    yield leave(
        "4.2.2",
        "detecting collisions takes too long for the haptic rate",
        'their computer; `contacts.detection = "haptics"` runs here',
        "hapticlink run enclosure --set contacts.detection=haptics",
    )
    yield compare(
        "4.2.2",
        "the haptics block applies contact forces where the graphics tell of a contact",
        are_connected(
            _touching(runs), "virtual_environment.contacts -> virtual_mechanism.contacts"
        ),
        'contacts.detection = "graphics" in scene `enclosure`',
        "hapticlink info enclosure",
    )
    off, frames = count_folded(pulled)
    error = pulled.graphics["virtual_environment.q_error"]
    frames_at = np.searchsorted(pulled.haptics["time"], pulled.graphics["time"] - 1e-12)
    reference = pulled.haptics["virtual_mechanism.x"][
        frames_at.clip(max=len(pulled.haptics["time"]) - 1)
    ]
    apart = pulled.graphics["virtual_environment.x"] - reference
    gap = 1e3 * np.hypot(apart[:, 0], apart[:, 1])
    yield compare(
        "4.2.2",
        "x_S is the reference of the graphics block, whose PD controller drives the error of the "
        "hand's position to zero",
        gap.max() < 0.5,
        f"it follows behind: median {np.median(gap):.2g} mm, at most {gap.max():.2g} mm and "
        f"{np.abs(apart[:, 2]).max():.2g} rad",
        STATED_6.command(ON, PULLED),
    )
    yield compare(
        "4.2.5",
        "the graphics controller drives the mechanism in the graphics to that in the haptics",
        off == 0,
        f"pulled so, it folds to the other assembly in {off} of "
        f"{frames} frames; its joints are up to {error.max():.2g} rad off",
        STATED_6.command(ON, PULLED),
    )
    q, x = (results.graphics[f"virtual_environment.{name}"] for name in ("q", "x"))
    found = appendix_a.r_h(q.T)[:2].T
    yield compare(
        "4.2.2",
        "generalised coordinates become operational ones in the block T",
        np.abs(found - x[:, :2]).max() < 1e-12,
        f"by (A) r_h to {np.abs(found - x[:, :2]).max():.0e} m",
        STATED_6.command(ON),
    )


def _teleoperation(runs: Runs) -> Iterator[Statement]:
    results = STATED_6.run(runs, ON)
    yield tested(
        "4.2.3; figure 4.5",
        "the four channels: two feed F_h and F_env forward, two of "
        "positions make F_drift by a PD controller",
        "F_drift = K_pc (x_S - x_D) + B_pc (v_S - v_D), + on the device and - on the mechanism",
        WHOLE_LAW,
    )
    held, loose = _drifts(runs)
    yield compare(
        "4.2.3",
        "four-channel control prevents the drift between device and simulation",
        held < loose / 5,
        f"{held:.2g} mm apart with it, {loose:.0f} mm without",
        f"{STATED_6.command(ON)}; {STATED_6.command(ON, 'controller.teleoperation=false')}",
    )
    full = {
        s.name: (tracking(s.run(runs, ON))[1].max(), tracking(s.run(runs, ON, FULL))[1].max())
        for s in (STATED_6, IDEAL_6)
    }
    said = "; ".join(
        f"{name}: {a:.2g} mm, and {b:.2g} with velocity terms sent" for name, (a, b) in full.items()
    )
    yield compare(
        "4.2.3",
        "the drift between device and simulation comes from numerical errors and delays",
        all(b > 0.7 * a for a, b in full.values()),
        f"most of it comes from the velocity terms that (5.1) neglects; {said}",
        "; ".join(s.command(ON, *more) for s in (STATED_6, IDEAL_6) for more in ((), (FULL,))),
    )
    sizes = measures.neglected(results)
    middle, _ = chapter4.ratio(runs("enclosure", *chapter4.STATED, chapter4.SHOWN))
    yield compare(
        "4.2.3; figure 4.6",
        "F_drift has to be small against F_env and F_h",
        sizes.drift_force < 0.2 * sizes.hand_force and middle < 0.2,
        f"as stated {sizes.drift_force:.2g} N RMS against F_h of {sizes.hand_force:.2g} N; "
        f"in a contact {100 * middle:.0f} % of F_env (median, `enclosure`)",
        f"{STATED_6.command(ON)}; {command('enclosure', *chapter4.STATED, chapter4.SHOWN)}",
    )
    k_j, values = channel_stiffness(results)
    yield compare(
        "4.2.3",
        "the PD controller of the four channels is weak, to keep F_drift small",
        values[0] < k_j / 10,
        f"per inertia {values[0]:.0f} and {values[1]:.0f} 1/s2 against {k_j:.0f} of the "
        "topology controller",
        STATED_6.command(ON),
    )


def _topology(runs: Runs) -> Iterator[Statement]:
    results = STATED_6.run(runs, ON)
    k_j, values = channel_stiffness(results)
    yield compare(
        "4.2.4",
        "the topology controller gets x_S and x_D and gives F_T",
        TOPOLOGY in results.haptics
        and are_connected(
            results,
            "virtual_mechanism.x -> controller.x_S",
            "haptic_device.x -> controller.x_D",
            "virtual_mechanism.v -> controller.v_S",
            "haptic_device.v -> controller.v_D",
            "haptic_device.M -> controller.M",
            "virtual_environment.P_c -> controller.P_c",
        ),
        "with both velocities, M_d and P_c",
        INFO,
    )
    yield misprinted(
        "4.2.4", "F_T is the output of the HD block", "of the topology controller, its input", INFO
    )
    yield compare(
        "4.2.4",
        "the topology controller is much stiffer than the position channels",
        k_j > 5 * values[0],
        f"per inertia {k_j:.0f} 1/s2 against {values[0]:.0f} and {values[1]:.0f}, the "
        "eigenvalues of Lambda^-1 K_pc for Table 6.1",
        STATED_6.command(ON),
    )
    shares = {
        s.name: measures.free_work(s.run(runs, ON), LENGTH_SCALE) for s in (STATED_6, IDEAL_6)
    }
    said = "; ".join(
        f"{name}: {100 * a:.2g} % (median), {100 * b:.2g} % (90th percentile)"
        for name, (a, b) in shares.items()
    )
    yield compare(
        "4.2.4; figure 4.7",
        "the topology controller acts along the singular directions of Lambda^-1 only",
        max(a for a, _ in shares.values()) < 0.01,
        f"its directions are a frame old; of F_T act on what is free then: {said}",
        "; ".join(s.command(ON) for s in (STATED_6, IDEAL_6)),
    )
    yield compare(
        "4.2.4",
        "the topology controller is needed since impedance control cannot restrict the hand",
        tracking(STATED_6.run(runs, OFF))[1].max() > 10 * tracking(results)[1].max(),
        f"{tracking(STATED_6.run(runs, OFF))[1].max():.0f} mm without, "
        f"{tracking(results)[1].max():.2g} mm with it",
        f"{STATED_6.command(ON)}; {STATED_6.command(OFF)}",
    )


def _summary(runs: Runs) -> Iterator[Statement]:
    yield compare(
        "4.2.5",
        "impedance control renders the inertia",
        measures.acceleration_error(IDEAL_6.run(runs, ON)) < 1e-3,
        f"to {measures.acceleration_error(IDEAL_6.run(runs, ON)):.0e} in the first period",
        IDEAL_6.command(ON),
    )
    held, loose = _drifts(runs)
    yield compare(
        "4.2.5",
        "four-channel control renders contacts and takes out drift",
        are_connected(_touching(runs), FELT) and held < loose,
        f"F_env reaches the device; {held:.2g} mm apart, {loose:.0f} mm without it: see 4.2.3",
        f"{command('enclosure', *chapter4.STATED, chapter4.SHOWN)}; {STATED_6.command(ON)}; "
        f"{STATED_6.command(ON, 'controller.teleoperation=false')}",
    )
    yield compare(
        "4.2.5",
        "impedance and topology control need Lambda^-1 and its singular directions",
        {"Lambda_inv", "P_c"}
        <= {name.rpartition(".")[2] for name in STATED_6.run(runs, ON).record.connections},
        "both are inputs of `controller`, from the graphics block",
        INFO,
    )
