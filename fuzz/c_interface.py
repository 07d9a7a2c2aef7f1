"""Random calls of the C interface of this project's FMUs: native ones, plain and under sanitizers,
and Python ones. Each call either returns a status, or the process is gone or never comes back."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

import fmpy

from fuzz import cases
from fuzz.caller import TOLD, Target
from fuzz.processes import own_folder
from hapticlink.components.blocks.hand import hand
from hapticlink.components.blocks.virtual_mechanism import virtual_mechanism
from hapticlink.components.component import Component
from hapticlink.components.specs.hand import ArmHand
from hapticlink.components.specs.linkage import Mechanism
from hapticlink.fmus.native.compiler import compile_library
from hapticlink.fmus.native.native_fmu_entries import WRAPPER
from hapticlink.fmus.native.source import component_source
from hapticlink.fmus.python_fmu_entries import entries
from tests.fmus import sample_components
from tests.mechanisms import five_bar

OUTCOMES = ("returned", "crashed", "hung")
CALLS = 2000
"""Of one process."""
PATIENCE = 300.0
"""Seconds after which CALLS calls are hung, on a machine that is busy with other things."""
GUID = "{attack}"
UNDEFINED = ("-fsanitize=undefined,float-cast-overflow", "-g")
"""What C leaves undefined: overflows of integers, indices and shifts, casts, null, alignment."""


@dataclass(frozen=True)
class Fmu:
    """One to be called, unpacked; `environment` is that of the process which loads it."""

    kind: str
    library: Path
    guid: str
    reals: int
    pointers: bool
    environment: Mapping[str, str]
    resources: str = ""


def native(component: Component, folder: Path) -> Fmu:
    return _compiled("native", component, folder, ())


def trapped(component: Component, folder: Path, wrapper: Path = WRAPPER) -> Fmu:
    """By zig's compiler, with a trap (SIGILL) at what is undefined."""
    options = (*UNDEFINED, "-fsanitize-trap=all")
    return _compiled("native, undefined behaviour trapped", component, folder, options, wrapper)


def sanitized(component: Component, folder: Path, wrapper: Path = WRAPPER) -> Fmu:
    """By gcc, with its libraries for addresses and undefined behaviour."""
    room = _sources(component, folder / "gcc")
    library = room / "library.so"
    flags = ["-shared", "-fPIC", "-std=gnu11", "-O1", *UNDEFINED, "-fsanitize=address"]
    headers = Path(fmpy.__file__).parent / "c-code"
    command = ["gcc", *flags, "-fno-sanitize-recover=all", f"-I{room}", f"-I{headers}"]
    command += [f"-I{WRAPPER.parent}"]
    subprocess.run([*command, "-o", library, wrapper, "-lm"], check=True)
    kind = "native, address and undefined-behaviour sanitizers"
    return Fmu(kind, library, GUID, _reals(component), True, sanitizer_environment())


def sanitizer_environment() -> dict[str, str]:
    """Variables of a process that loads a library with gcc's address sanitizer."""
    return {
        "LD_PRELOAD": _address_library(),
        "ASAN_OPTIONS": "detect_leaks=0",
        "PYTHONMALLOC": "malloc",  # else small arrays lie beside each other in one block
    }


def can_sanitize() -> bool:
    return sys.platform == "linux" and shutil.which("gcc") is not None and bool(_address_library())


def python(component: Component, folder: Path) -> Fmu:
    """pythonfmu's library looks at no pointer, so none is null."""
    room = folder / f"python-{component.name}"
    for name, content in entries(component, stop_time=1.0, step_size=1 / 512).items():
        path = room / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
    library = room / "binaries" / fmpy.platform / f"{component.name}{fmpy.sharedLibraryExtension}"
    about = json.loads((room / "resources" / "component.json").read_text())
    resources = (room / "resources").as_uri()
    quick = {"HAPTICLINK_PURE_PYTHON": "1"}
    return Fmu("Python", library, about["guid"], _reals(component), False, quick, resources)


def _compiled(
    kind: str, component: Component, folder: Path, options: Iterable[str], wrapper: Path = WRAPPER
) -> Fmu:
    room = _sources(component, folder / kind.replace(" ", "-"))
    exported = ["-fvisibility=default", f"-I{room}", f"-I{WRAPPER.parent}", *options]
    library = compile_library(wrapper, room / "library.so", options=exported)
    return Fmu(kind, library, GUID, _reals(component), True, {})


def _sources(component: Component, folder: Path) -> Path:
    room = folder / component.name
    room.mkdir(parents=True)
    text = f'#define GUID "{GUID}"\n' + component_source(component)[0]
    (room / "component.h").write_text(text)
    return room


def _reals(component: Component) -> int:
    settable = len(component.start_inputs) + len(component.start_parameters)
    return settable + sum(v.size for v in component.outputs)


def _address_library() -> str:
    command = ["gcc", "-print-file-name=libasan.so"]
    found = subprocess.run(command, capture_output=True, text=True, check=False).stdout.strip()
    return found if Path(found).is_absolute() else ""


def called(fmu: Fmu, number: int, seed: int, folder: Path) -> Iterator[cases.Made]:
    """A case is a call; those of a process that dies count as one."""
    told = folder / "told"
    for first in range(0, number, CALLS):
        told.write_bytes(bytes(TOLD))
        calls = min(CALLS, number - first)
        target = Target(
            str(fmu.library), fmu.guid, fmu.resources, fmu.reals, fmu.pointers,
            str(told), seed * 1_000_000 + first, calls,
        )  # fmt: skip
        command = [sys.executable, str(Path(__file__).with_name("caller.py"))]
        try:
            done = subprocess.run(
                [*command, json.dumps(asdict(target))],
                env=os.environ | fmu.environment,
                capture_output=True,
                timeout=PATIENCE,
                check=False,
            )
            status, said = done.returncode, done.stderr.decode(errors="replace")
        except subprocess.TimeoutExpired:
            status, said = None, f"no end after {PATIENCE:g} s"
        if status == 0:
            yield from [cases.Made(fmu.kind, "", "returned")] * calls
        else:
            last = told.read_bytes().decode(errors="replace").strip()
            wrong = f"status {status} in {last}: {said[-3000:]}"
            case = f"{fmu.library.name}, seed {target.seed}"
            yield cases.Made(fmu.kind, case, "hung" if status is None else "crashed", wrong)


BROKEN = {
    "trapped": (("is_unknown(m, vr[i], REALS)", "is_unknown(m, vr[i], REALS + 1)"),),
    "sanitized": (
        ("is_unknown(m, vr[i], REALS)", "is_unknown(m, vr[i], REALS + 1)"),
        ("size < sizeof(State)", "size < 8"),
    ),
}
"""By how it is compiled, checks of the wrapper, and the same ones with a fault."""


def check_that_faults_are_found(make: Callable[..., Fmu], folder: Path) -> None:
    """Breaks the wrapper on purpose. Raises AssertionError where no call crashes then."""
    for i, (good, bad) in enumerate(BROKEN.get(make.__name__, ())):
        text, room = WRAPPER.read_text(), folder / f"broken-{make.__name__}-{i}"
        room.mkdir()
        assert good in text, f"{WRAPPER.name} has no {good!r}: put a check that it has into BROKEN"
        (room / "broken.c").write_text(text.replace(good, bad))
        broken = make(sample_components.controller(), room, room / "broken.c")
        crashed = any(case.outcome == "crashed" for case in called(broken, 4000, 7, room))
        assert crashed, f"{broken.kind}: {bad!r} in the place of {good!r} is not found"


KINDS: tuple[Callable[[Component, Path], Fmu], ...] = (native, trapped, sanitized, python)


def attack(number: int, seed: int) -> Iterator[cases.Made]:
    """`number` calls, shared by what is built: small blocks, tables, the report's mechanism."""
    rows = tuple((0.01 * i, float(i % 3), 0.0, 0.0) for i in range(300))
    made = (
        sample_components.spring(),
        sample_components.controller(),
        sample_components.fragile(),
        hand(ArmHand(target=rows)),
        virtual_mechanism(five_bar(), Mechanism(), step_s=1 / 512),
    )
    kinds = [k for k in KINDS if k is not sanitized or can_sanitize()]
    share = max(1, number // (len(made) * len(kinds)))
    with own_folder() as folder:
        for kind in kinds:
            check_that_faults_are_found(kind, folder)
            for component in made:
                yield from called(kind(component, folder), share, seed, folder)
