"""The scene that a page shows: the given one, with the mouse in place of its hand."""

from __future__ import annotations

import pickle

from hapticlink.components import registry
from hapticlink.components.port_space import PortSpace
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base import plugins
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.base.signal_names import HAND, block_of_user
from hapticlink.orchestrator.scene.blocks import driver_of
from hapticlink.orchestrator.scene.overrides import Options, write_options
from hapticlink.orchestrator.scene.scene import Scene

Three = tuple[float, float, float]
STIFFNESS, DAMPING = (100.0, 0.0), (5.0, 0.005)
"""Of the mouse's spring and damper to the handle along and about axes: they leave its turn free but
damped."""
DURATION = 600.0
"""s after which a page begins anew, which bounds what a run keeps on the disk."""


def load_viewed_scene(name: str, options: Options = (), duration: float = DURATION) -> Scene:
    """The scene with a spring hand for each user without a board that pulls nowhere yet, of
    compiled FMUs if the options say nothing else, and without its end at the border of the
    workspace. Raises InputFault for a scene without a linkage, or one that has an FMU of the user's
    in place of a hand."""
    linkage = open_scene.load(name, options).linkage
    if linkage is None:
        raise InputFault(
            f"{name}: has no [linkage], so that there is nothing to take hold of; view shows "
            "mechanisms, for instance `hapticlink view closed-loop`"
        )
    read = open_scene.load(name, (*write_options({"packaging": "native"}), *write_options(options)))
    hands = [block_of_user(HAND, user) for user in ("", *read.devices)]
    if any(fmu.replaces in hands for fmu in read.fmu):
        raise InputFault(
            f"{name}: an FMU replaces the hand, which the mouse has to be: leave it out"
        )
    hand = {
        "type": "spring",
        "stiffness": [0.0, 0.0, 0.0],
        "damping": mouse(linkage.space)[1],
        "target": [[0.0, 0.0, 0.0, 0.0]],
    }
    record = {"signals": "all"}  # what is not recorded is not read from its FMU
    changes: dict[str, object] = {"duration": duration, "record": record}
    moved = [user for user in ("", *read.devices) if not driver_of(read, user)]
    changes |= {f"hands.{user}" if user else "hand": hand for user in moved}
    if read.stop_when is None and read.ends_when:
        changes["stop_when"] = ""
    return open_scene.load(read, changes)


def mouse(space: PortSpace) -> tuple[Three, Three]:
    """Stiffness and damping of the mouse's spring, an entry for each direction of the handle."""
    x, y, z = space.turns
    return (STIFFNESS[x], STIFFNESS[y], STIFFNESS[z]), (DAMPING[x], DAMPING[y], DAMPING[z])


def simulated(scene: Scene) -> Scene:
    """The scene without boards, as a verdict takes it."""
    boards = {f"{'devices.' + u if u else 'device'}.driver.port": "" for u in scene.all_devices
              if driver_of(scene, u)}  # fmt: skip
    return open_scene.load(scene, boards) if boards else scene


def pack_scene(scene: Scene) -> bytes:
    """A scene for another process, with the plugins that it needs."""
    return pickle.dumps((tuple(registry.origins()), pickle.dumps(scene)))


def unpack_scene(content: bytes) -> Scene:
    """The scene of `pack_scene`."""
    modules, pickled = pickle.loads(content)
    plugins.load(modules)
    scene: Scene = pickle.loads(pickled)
    return scene
