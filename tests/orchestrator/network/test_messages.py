"""Messages: what is sent arrives as it was, and nothing else is taken."""

from __future__ import annotations

import math
from typing import Any

import msgpack
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticlink.orchestrator.network import messages
from hapticlink.orchestrator.network.messages import Answer, Malformed, Request

TEXT = st.text(st.characters(exclude_categories=("Cs",)))
"""Of no codec, of which hypothesis would try each character."""
PLAIN: Any = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**63), 2**63) | st.floats() | st.binary() | TEXT,
    lambda inner: st.lists(inner) | st.dictionaries(TEXT, inner),
    max_leaves=20,
)
STEP = Request(bytes(16), 7, 10**18, [[0, b"12345678"]], "step", [0.25, 0.5, 0.25])
OUTPUTS = [b"12345678" * 2, None, False, 0.1]
FAULT = ["fmi2DoStep failed", 0.25, ["it says"], True]


def test_a_request_and_an_answer_arrive_as_they_were_sent() -> None:
    assert messages.request_of(STEP.packed()) == STEP
    for kind, content in (("answer", OUTPUTS), ("fault", FAULT), ("refused", "no")):
        answer = Answer(7, 1, 2, 3, kind, content)
        assert messages.answer_of(answer.packed(), "step", 2) == answer


@given(st.binary(max_size=300) | PLAIN.map(msgpack.packb))
def test_random_bytes_are_malformed(message: bytes) -> None:
    with pytest.raises(Malformed):
        messages.request_of(message)
    for call in ("step", "connect", "hello"):
        with pytest.raises(Malformed):
            messages.answer_of(message, call, 2)


@given(st.integers(0, len(STEP.packed()) - 1), st.binary(min_size=1, max_size=1))
def test_a_changed_byte_is_malformed_or_another_request(place: int, byte: bytes) -> None:
    """It never raises anything else, which would end the server."""
    packed = STEP.packed()
    try:
        request = messages.request_of(packed[:place] + byte + packed[place + 1 :])
    except Malformed:
        return
    assert len(request.session) == 16
    assert request.call == "step"
    assert all(map(math.isfinite, request.arguments))


@pytest.mark.parametrize(
    "change",
    [
        {"session": b"short"},
        {"number": -1},
        {"call": "__class__"},
        {"call": "load"},
        {"arguments": [0.25, 0.5]},
        {"arguments": [0.25, 0.5, math.nan]},
        {"arguments": [True, 0.5, 0.25]},
        {"pending": [[0]]},
        {"pending": [["0", b""]]},
    ],
)
def test_a_request_of_another_form_is_malformed(change: dict[str, Any]) -> None:
    with pytest.raises(Malformed):
        messages.request_of(Request(**{**vars(STEP), **change}).packed())


@pytest.mark.parametrize(
    ("kind", "content"),
    [
        ("answer", [b"12345678", *OUTPUTS[1:]]),
        ("answer", OUTPUTS[:3]),
        ("answer", [*OUTPUTS[:3], "0"]),
        ("answer", None),
        ("fault", FAULT[:3]),
        ("fault", [*FAULT[:2], [1], True]),
        ("refused", 5),
        ("other", OUTPUTS),
    ],
)
def test_an_answer_of_another_form_or_size_is_malformed(kind: str, content: Any) -> None:
    with pytest.raises(Malformed):
        messages.answer_of(Answer(7, 1, 2, 3, kind, content).packed(), "step", 2)
