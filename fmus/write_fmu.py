"""Writes an FMU as a file, if FMPy's validation has no finding."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

from fmpy import read_model_description
from fmpy.validation import validate_fmu

from hapticlink.fmus.atomic_file import atomic_file
from hapticlink.fmus.errors import FmuError
from hapticlink.fmus.reproducible_zip import write_zip

_PLAIN = re.compile(
    r"(?!der\()[A-Za-z_]\w*(\[\d+(,\d+)*\])?(\.[A-Za-z_]\w*(\[\d+(,\d+)*\])?)*", re.A
)
"""Names that the grammar of FMI 2.0.5 section 2.2.9 allows, without quotes or derivatives."""


def write_fmu(files: Mapping[str, bytes], folder: Path | str, name: str) -> Path:
    """Write `<folder>/<name>.fmu` from its entries, atomically, and return its path. Raises
    FmuError with the findings of the validation."""
    target = Path(folder) / f"{name}.fmu"
    target.parent.mkdir(parents=True, exist_ok=True)
    with atomic_file(target) as unfinished:
        with unfinished.open("xb") as file:
            write_zip(files, file)
        if found := findings(str(unfinished)):
            raise FmuError(f"`{name}` fails validation:\n  " + "\n  ".join(found))
    return target


def findings(path: str) -> list[str]:
    """The findings of FMPy's validation of a file that `write_fmu` has written. Its parser of names
    takes up to 20 ms for each, 3 s for those of a scene, and is left out if all names are plain."""
    try:
        description = read_model_description(path, validate=True, validate_model_structure=True)
    except Exception:  # whatever it is, FMPy says it as a finding
        return validate_fmu(path)
    names = (variable.name for variable in description.modelVariables)
    return [] if all(map(_PLAIN.fullmatch, names)) else validate_fmu(path)
