"""A relay between a run and a server of FMUs that is a bad network: it delays, loses and overtakes
whole messages, by a seed.

    python -m benchmarks.network_relay FROM TO KEY DELAY JITTER LOSS SEED CUT

FROM and TO are HOST:PORT. Each message of either way arrives DELAY + JITTER u later (s), u uniform
in [0, 1), so that messages overtake each other; LOSS is the probability that it is lost. Between
CUT and CUT + 2 s after the first message all are lost; a negative CUT is none.
"""

from __future__ import annotations

import heapq
import math
import sys
from itertools import count
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np
import zmq

from hapticlink.orchestrator.network import key_file

CUT = 2.0
"""Length of a cut (s)."""


def relay(
    listen: str, to: str, key: key_file.Key, delay: float, jitter: float, loss: float, seed: int,
    cut: float,
) -> None:  # fmt: skip
    """Relay until the process is ended."""
    context, draw = zmq.Context(), np.random.Generator(np.random.PCG64(seed)).random
    front = context.socket(zmq.ROUTER)
    front.curve_server, front.curve_secretkey = True, key.secret
    front.bind(f"tcp://{listen}")
    poller, behind = zmq.Poller(), dict[bytes, Any]()
    peers: dict[Any, bytes] = {}
    poller.register(front, zmq.POLLIN)
    waiting: list[tuple[float, int, Any, list[bytes]]] = []
    order, began = count(), math.inf

    def connected() -> Any:
        socket = context.socket(zmq.DEALER)
        socket.curve_publickey, socket.curve_secretkey = key
        socket.curve_serverkey = key.public
        socket.connect(f"tcp://{to}")
        poller.register(socket, zmq.POLLIN)
        return socket

    while True:
        now = monotonic()
        while waiting and waiting[0][0] <= now:
            _, _, socket, parts = heapq.heappop(waiting)
            socket.send_multipart(parts)
        patience = math.ceil(1e3 * (waiting[0][0] - now)) if waiting else None
        for socket, _ in poller.poll(patience):
            parts = socket.recv_multipart()
            now = monotonic()
            began = min(began, now)
            late, luck = delay + jitter * draw(), draw()
            lost = luck < loss or (cut >= 0 and cut <= now - began < cut + CUT)
            if socket is front:
                peer, message = parts
                if peer not in behind:
                    behind[peer] = connected()
                    peers[behind[peer]] = peer
                target, parts = behind[peer], [message]
            else:
                target, parts = front, [peers[socket], *parts]
            if not lost:
                heapq.heappush(waiting, (now + late, next(order), target, parts))


if __name__ == "__main__":
    listen, to, key, *numbers = sys.argv[1:]
    delay, jitter, loss, seed, cut = map(float, numbers)
    relay(listen, to, key_file.read_key(Path(key)), delay, jitter, loss, int(seed), cut)
