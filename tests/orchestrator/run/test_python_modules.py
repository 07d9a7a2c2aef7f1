"""What Python FMUs of a process share, and what each has of its own."""

import sys
from pathlib import Path

import pytest

import hapticlink as hl
from hapticlink.fmus import python_fmu_entries
from hapticlink.orchestrator.fmi import process_cache
from hapticlink.orchestrator.fmi.description import describe
from hapticlink.orchestrator.run import python_modules
from hapticlink.orchestrator.run.python_modules import find_bundled
from hapticlink.orchestrator.system.build_system import build_system

SCENES = "pendulum", "single-body"


def test_slaves_are_compiled_once_for_all_and_are_modules_of_their_own() -> None:
    """Each FMU's class has functions of its own, and a text that is not this package's its own."""
    loaded = []
    for scene in SCENES:
        hl.run(scene, {"duration": 0.01})
        with build_system(hl.scene(scene)) as system:
            bundled = find_bundled(system.fmus[0].description.path)
        (name,) = (n for n in bundled if n.endswith("_slave"))
        loaded.append(sys.modules[name])
    assert {module.__file__ for module in loaded} == {str(python_modules.SLAVE)}
    assert python_modules.SLAVE.samefile(
        Path(python_fmu_entries.__file__).with_name("python_slave.py")
    )
    one, other = (module.HapticlinkSlave for module in loaded)
    assert one is not other
    assert one._loaded is not other._loaded


def test_a_slave_with_another_text_is_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    name, crc = "hapticlink_0123456789abcdef_slave", python_modules._crc_of_slave()
    for given, taken in ((crc ^ 1, False), (crc, True)):
        monkeypatch.delitem(sys.modules, name, raising=False)
        python_modules._import_slave(name, {f"{name}.py": given})
        assert (name in sys.modules) == taken


def test_pythonfmu_is_unpacked_where_none_is_imported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (path,) = hl.build("pendulum", out=tmp_path).values()
    import pythonfmu

    assert pythonfmu
    for there, folder in ((True, tmp_path / "a"), (False, tmp_path / "b")):
        if not there:
            monkeypatch.delitem(sys.modules, "pythonfmu")
        folder.mkdir()
        process_cache.unpack(describe(path), str(folder))
        assert (folder / "resources" / "slavemodule.txt").exists()
        assert (folder / "resources" / "pythonfmu").exists() != there
