"""Changes that hurt, seeded: to trees of values, to text, to bytes."""

from __future__ import annotations

import copy
import random
from collections.abc import Iterator
from typing import Any

Path = tuple[Any, ...]

NUMBERS = (
    *(0, 0.0, -0.0, 1, -1, 0.5, 2, 1e-9, 1e9, 1e-300, 1e300, 5e-324, 1.7e308, -1.7e308),
    *(float("nan"), float("inf"), float("-inf"), 2**31, 2**32, 2**53 + 1, 2**63, -(2**63) - 1),
    *(10**30, 10**400, True, False),
)
TEXTS = (
    *("", " ", "ground", "haptics", "graphics", "none", "zoh", "pd", "free", "1", "1/30", "1/0"),
    *("1e99999999", "0x10", "nan", "²", "é" * 50, "a\nb", "a\tb", 'a"b', "a,b", "a.b", "a[1]"),
    *("x" * 5000, "../..", "/dev/zero", "/etc/passwd", "\x00", "\x1b[31m", "%s%n", "=", "#"),
    *("operational_point", "type", "name", "time", "hand", "CON", "-", "--out", "a -> b", "\ufeff"),
)
TABLES = (
    *([], {}, [[]], [{}], {"": 1}, [float("nan")], [1, "a"], [0.0] * 3, [[0.0, 0.0]] * 3),
    *({"type": "spring"}, {"type": 3}, {"min": 1, "max": 1000}, {"trace": "/dev/zero"}),
    *({"trace": "none.csv"}, {"name": "a"}, list(range(1000)), {"min": 0.0, "loss": 1.0}),
    [[[[[[[[[[]]]]]]]]]],
)
LETTERS = "[]{}=.,\"'#\n \\\t0-_eE+:\x00\x7f\u2028é"


def places(tree: Any, path: Path = ()) -> Iterator[Path]:
    """Every path of a tree of tables and lists."""
    if path:
        yield path
    inside = tree.items() if isinstance(tree, dict) else enumerate(tree)
    if isinstance(tree, dict | list):
        for key, value in inside:
            if isinstance(value, dict | list):
                yield from places(value, (*path, key))
            else:
                yield (*path, key)


def at(tree: Any, path: Path) -> Any:
    for key in path:
        tree = tree[key]
    return tree


def mutated(tree: Any, draw: random.Random) -> tuple[Any, str]:
    """The tree with one change, and what it is. Values come from TEXTS and the others above, or
    from elsewhere in the tree: of a right kind, and wrong."""
    tree = copy.deepcopy(tree)
    paths = [*places(tree)]
    if not paths:
        return tree, "nothing"
    path = draw.choice(paths)
    node, key, old = at(tree, path[:-1]), path[-1], at(tree, path)
    how = draw.choice((*["near"] * 5, "value", "value", "other", "drop", "twice", "key", "wrap"))
    if how == "value":
        kinds = (NUMBERS, TEXTS, TABLES)
        same = 0 if isinstance(old, int | float) else 1 if isinstance(old, str) else 2
        node[key] = draw.choice(draw.choice((*kinds, kinds[same], kinds[same])))
    elif how == "near":
        node[key] = near(old, draw)
    elif how == "other":
        node[key] = copy.deepcopy(at(tree, draw.choice(paths)))
    elif how == "drop":
        del node[key]
    elif how == "twice" and isinstance(node, list):
        node.insert(key, copy.deepcopy(old))
    elif how in ("twice", "key") and isinstance(node, dict):
        names = [*(p[-1] for p in paths if isinstance(p[-1], str)), *TEXTS]
        node[draw.choice(names)] = copy.deepcopy(old) if how == "twice" else node.pop(key)
    else:
        node[key] = draw.choice(([old], {"a": old}, {str(key): old}, [old, old]))
    return tree, f"{how} at {'.'.join(map(str, path))}"


def near(value: Any, draw: random.Random) -> Any:
    """A value of the same kind that is not far."""
    if isinstance(value, bool):
        return not value
    if isinstance(value, int | float):
        factor = draw.choice((-1, 0.5, 0.9, 1.1, 2, 10, 1e-3, 1e3, 1e-6, 1e6, 1e-12, 1e12))
        return draw.choice((value * factor, value + 1, round(value) if abs(value) < 1e9 else 0))
    if isinstance(value, str):
        return text(value, draw)
    if isinstance(value, list):
        value = list(value)
        draw.shuffle(value)
        return value[: draw.randrange(len(value) + 1)] + value[: draw.choice((0, 0, 1, 2))]
    return {k: v for k, v in value.items() if draw.random() < 0.6}


def text(value: str, draw: random.Random) -> str:
    """Text with a letter, a word or a line put in, taken out, doubled or exchanged."""
    i = draw.randrange(len(value) + 1)
    j = min(len(value), i + draw.choice((0, 0, 1, 1, 2, 5, 50)))
    piece = draw.choice(("", draw.choice(LETTERS), draw.choice(TEXTS), value[i:j] * 2, value[:9]))
    return value[:i] + piece + value[j:]


def lines(value: str, draw: random.Random) -> str:
    """Text with lines dropped, doubled, moved or broken, or what `text` does."""
    rows = value.split("\n")
    i, j = draw.randrange(len(rows)), draw.randrange(len(rows))
    how = draw.randrange(5)
    if how == 0:
        rows.pop(i)
    elif how == 1:
        rows.insert(j, rows[i])
    elif how == 2:
        rows[i], rows[j] = rows[j], rows[i]
    elif how == 3:
        rows = rows[: max(i, 1)]
    else:
        return text(value, draw)
    return "\n".join(rows)


def flipped(content: bytes, draw: random.Random) -> bytes:
    """Bytes with some changed, cut out, put in, or the end gone."""
    found = bytearray(content)
    for _ in range(draw.choice((1, 1, 2, 8))):
        i = draw.randrange(max(len(found), 1))
        how = draw.randrange(8)
        if how == 0:
            del found[i:]
        elif how == 1:
            del found[i : i + draw.choice((1, 4, 100))]
        elif how == 2:
            found[i:i] = draw.randbytes(draw.choice((1, 4, 100)))
        elif i < len(found):
            found[i] = found[i] ^ (1 << draw.randrange(8)) if how < 6 else draw.randrange(256)
    return bytes(found)
