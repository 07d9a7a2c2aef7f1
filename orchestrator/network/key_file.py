"""The key that both computers need: a CURVE key pair of ZeroMQ, in one file that both have.

Whoever has the file may serve and run; nobody else can read what is sent, or send anything that is
read (CurveZMQ, ZeroMQ RFC 26).
"""

from __future__ import annotations

import logging
import os
import re
from pathlib import Path
from typing import NamedTuple

from hapticlink.fmus.versions import install_command
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.base.text_files import read_text

DEFAULT = Path("~/.config/hapticlink/network.key_secret")
"""Where the key is if no other file is named."""
FORM = """\
# A secret key of hapticlink: whoever has it may serve and run.
curve
    public-key = "{public}"
    secret-key = "{secret}"
"""
"""A certificate as pyzmq's `zmq.auth` writes and reads it."""
LINE = re.compile(r'^\s*(public|secret)-key\s*=\s*"(.*)"\s*$', re.MULTILINE)
LARGEST = 10_000
"""Bytes of a key's file."""


class Key(NamedTuple):
    """A CURVE key pair, each of 40 characters in Z85 (ZeroMQ RFC 32)."""

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
    """Make a key where nothing has that name, no link either, for its owner's eyes alone; whether
    it was made. Raises OSError where it cannot be written."""
    require_libraries()
    import zmq

    path = path.expanduser()
    if os.path.lexists(path):
        return False
    path.parent.parent.mkdir(parents=True, exist_ok=True)
    path.parent.mkdir(mode=0o700, exist_ok=True)
    public, secret = (half.decode() for half in zmq.curve_keypair())
    try:
        number = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    except FileExistsError:  # another server was quicker
        return False
    try:
        with os.fdopen(number, "w", encoding="ascii") as file:
            file.write(FORM.format(public=public, secret=secret))
    except OSError:
        path.unlink()
        raise
    return True


def read_key(path: Path) -> Key:
    """The key in a file; one that others may read is logged as a warning. Raises InputFault where
    there is none."""
    require_libraries()
    import zmq

    path = path.expanduser()
    remedy = "copy there the file that `hapticlink serve` has made"
    try:
        text = read_text(path, "a key", LARGEST)
        halves = dict(LINE.findall(text))
        public, secret = (halves[half].encode("ascii") for half in ("public", "secret"))
        if zmq.curve_public(secret) != public:
            raise InputFault(f"{path}: its two halves do not belong together")
    except InputFault as why:
        raise InputFault(f"no key: {why}; {remedy}") from None
    except (KeyError, ValueError, zmq.ZMQError):
        raise InputFault(
            f"no key: {path}: it needs public-key and secret-key, 40 characters each; {remedy}"
        ) from None
    if os.name == "posix" and path.stat().st_mode & 0o077:
        logging.getLogger(__name__).warning(
            "%s: other users of this computer may read this key: chmod 600 %s", path, path
        )
    return Key(public, secret)
