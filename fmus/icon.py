"""model.png of an FMU: a smooth wave for a continuous block, its samples held for a sampled."""

from __future__ import annotations

import math
import struct
import zlib
from itertools import pairwise

SIZE = 96
Point = tuple[float, float]
INK, PAPER = (31, 78, 121), (255, 255, 255)


def icon(timing: str) -> bytes:
    """A PNG of 96 x 96 pixels; the same bytes every time."""
    line = _wave() if timing == "continuous" else _steps()
    frame = [(3.0, 3.0), (93.0, 3.0), (93.0, 93.0), (3.0, 93.0), (3.0, 3.0)]
    ink = [[0.0] * SIZE for _ in range(SIZE)]
    for points, width in ((frame, 2.0), (line, 3.0)):
        for start, end in pairwise(points):
            _draw(ink, start, end, width)
    rows = bytearray()
    for row in ink:
        rows.append(0)  # PNG filter type: none
        for share in row:
            rows += bytes(round(p + share * (c - p)) for c, p in zip(INK, PAPER, strict=True))
    head = struct.pack(">IIBBBBB", SIZE, SIZE, 8, 2, 0, 0, 0)
    chunks = ((b"IHDR", head), (b"IDAT", zlib.compress(bytes(rows), 9)), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(_chunk(kind, data) for kind, data in chunks)


def _curve(x: float) -> float:
    return 48.0 - 26.0 * math.sin(2.0 * math.pi * (x - 15.0) / 66.0)


def _wave() -> list[Point]:
    return [(float(x), _curve(x)) for x in range(15, 82, 2)]


def _steps() -> list[Point]:
    edges = [15.0 + 11.0 * k for k in range(7)]
    points = []
    for left, right in pairwise(edges):
        points += [(left, _curve(left + 2.75)), (right, _curve(left + 2.75))]
    return points


def _draw(ink: list[list[float]], a: Point, b: Point, width: float) -> None:
    """A stroke from a to b: 1 inside, 0 outside, linear over the pixel between."""
    (left, right), (top, bottom) = sorted((a[0], b[0])), sorted((a[1], b[1]))
    for j in range(max(0, int(top - width)), min(SIZE, int(bottom + width) + 1)):
        for i in range(max(0, int(left - width)), min(SIZE, int(right + width) + 1)):
            share = width / 2.0 + 0.5 - _distance(i + 0.5, j + 0.5, a, b)
            ink[j][i] = max(ink[j][i], min(1.0, share))


def _distance(x: float, y: float, a: Point, b: Point) -> float:
    """From a point to the segment a b."""
    dx, dy = b[0] - a[0], b[1] - a[1]
    along = ((x - a[0]) * dx + (y - a[1]) * dy) / (dx * dx + dy * dy)
    along = min(1.0, max(0.0, along))
    return math.hypot(x - a[0] - along * dx, y - a[1] - along * dy)


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
