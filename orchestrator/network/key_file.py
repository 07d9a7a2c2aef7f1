"""The key that both computers need: a CURVE key pair of ZeroMQ, in one file that both have.

Whoever has the file may serve and run; nobody else can read what is sent, or send anything that is
read (CurveZMQ, ZeroMQ RFC 26).
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import NamedTuple

from hapticlink.fmus.versions import install_command
from hapticlink.orchestrator.base.errors import InputFault

DEFAULT = Path("~/.config/hapticlink/network.key_secret")
"""Where the key is if no other file is named."""


class Key(NamedTuple):
    """A CURVE key pair, each in Z85 (ZeroMQ RFC 32)."""

    public: bytes
    secret: bytes


def require_libraries() -> None:
    """Raises InputFault where pyzmq or msgpack is missing, or pyzmq has no CURVE."""
    try:
        import msgpack  # noqa: F401
        import zmq
    except ModuleNotFoundError as missing:
        remedy = install_command("network")
        raise InputFault(f"two computers need {missing.name}: {remedy}") from None
    if not zmq.has("curve"):
        raise InputFault("two computers need a pyzmq with CURVE, as its wheels are")


def create(path: Path) -> bool:
    """Make a key where there is none, for its owner's eyes alone; whether it was made."""
    require_libraries()
    import zmq.auth

    path = path.expanduser()
    if path.exists():
        return False
    path.parent.mkdir(parents=True, exist_ok=True)
    before = os.umask(0o077)
    try:
        public, secret = zmq.auth.create_certificates(path.parent, path.name)
    finally:
        os.umask(before)
    Path(public).unlink()  # the other file contains it, too
    Path(secret).rename(path)
    return True


def read_key(path: Path) -> Key:
    """The key in a file. Raises InputFault where there is none."""
    require_libraries()
    import zmq.auth

    try:
        public, secret = zmq.auth.load_certificate(path.expanduser())
    except (OSError, ValueError) as error:
        raise InputFault(
            f"{path}: no key: {error}: copy there the file that `hapticlink serve` has made"
        ) from None
    if not secret:
        raise InputFault(f"{path}: it has no secret key: copy the file that `serve` has made")
    return Key(public, secret)
