"""The file of the key: made where nothing is, for its owner alone; read only where it is one."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.network import key_file

zmq = pytest.importorskip("zmq")
auth = pytest.importorskip("zmq.auth")
pytest.importorskip("msgpack")


def test_a_key_is_what_it_was_made_and_pyzmq_reads_it(tmp_path: Path) -> None:
    path = tmp_path / "new" / "key"
    assert key_file.create(path)
    made = key_file.read_key(path)
    assert auth.load_certificate(path) == tuple(made)
    assert not key_file.create(path)
    assert key_file.read_key(path) == made
    if os.name == "posix":
        assert [p.stat().st_mode & 0o777 for p in (path, path.parent)] == [0o600, 0o700]


def test_files_of_others_stay_as_they_are(tmp_path: Path) -> None:
    """server.key and server.key_secret, which pyzmq makes on the way to a key `server`."""
    theirs = [tmp_path / name for name in ("server.key", "server.key_secret", "victim")]
    for path in theirs:
        path.write_text("theirs")
        path.chmod(0o644)
    assert key_file.create(tmp_path / "server")
    assert {path.read_text() for path in theirs} == {"theirs"}
    (tmp_path / "link").symlink_to(tmp_path / "victim")
    (tmp_path / "dangling").symlink_to(tmp_path / "none")
    for name in ("link", "dangling"):
        assert not key_file.create(tmp_path / name)
    assert theirs[2].read_text() == "theirs"
    assert not (tmp_path / "none").exists()


@pytest.mark.parametrize("text", ["", "KEY", 'public-key = "KEY"\nsecret-key = "KEY"', "\0" * 500])
def test_what_is_no_key_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "key").write_text(text)
    with pytest.raises(InputFault, match=r"no key: .*`hapticlink serve` has made"):
        key_file.read_key(tmp_path / "key")


def test_halves_of_two_keys_are_refused(tmp_path: Path) -> None:
    public, secret = zmq.curve_keypair()[0], zmq.curve_keypair()[1]
    key = key_file.FORM.format(public=public.decode(), secret=secret.decode())
    (tmp_path / "key").write_text(key)
    with pytest.raises(InputFault, match="do not belong together"):
        key_file.read_key(tmp_path / "key")


@pytest.mark.skipif(os.name != "posix", reason="pipes and devices are files of Unix")
def test_what_has_no_end_is_refused(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", Path("/dev/zero"), tmp_path):
        with pytest.raises(InputFault, match=r"no key: .*: not a regular file"):
            key_file.read_key(path)
    (tmp_path / "large").write_text("x" * (key_file.LARGEST + 1))
    with pytest.raises(InputFault, match="more than"):
        key_file.read_key(tmp_path / "large")


@pytest.mark.skipif(os.name != "posix", reason="permissions of Unix")
def test_a_key_that_others_may_read_is_told(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    key_file.create(tmp_path / "key")
    key_file.read_key(tmp_path / "key")
    assert not caplog.messages
    (tmp_path / "key").chmod(0o644)
    key_file.read_key(tmp_path / "key")
    assert "chmod 600" in caplog.text
