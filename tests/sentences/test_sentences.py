"""Every sentence that claims something has a premise, and a test that breaks it.

`claims.toml` lists the sentences that `collect.py` finds. A new one fails here until somebody has
looked at what must be true for it: it is a claim with its premise, and the tests in which that is
broken and the sentence changes; a refusal, which claims no more than its own condition; or a label,
which names a quantity or an option and claims nothing.
"""

from __future__ import annotations

import ast
import tomllib
from collections import Counter
from functools import cache
from pathlib import Path

from tests.sentences import collect

TABLE = Path(__file__).with_name("claims.toml")


@cache
def table() -> dict[str, list]:
    return tomllib.loads(TABLE.read_text(encoding="utf-8"))


def listed() -> Counter[str]:
    claims = (sentence for claim in table()["claim"] for sentence in claim["says"])
    return Counter([*claims, *table()["refusals"], *table()["labels"]])


def test_every_sentence_that_claims_something_is_listed_once() -> None:
    found = {sentence: file for file, said in collect.sentences().items() for sentence in said}
    new = {s: file for s, file in found.items() if s not in listed()}
    assert not new, "look at the premise of each, and list it in tests/sentences/claims.toml"
    assert not set(listed()) - set(found), "no longer said"
    assert [s for s, n in listed().items() if n > 1] == []


def test_every_premise_is_broken_by_a_test_that_there_is() -> None:
    missing = [
        test
        for claim in table()["claim"]
        for test in claim["broken_by"]
        if test.partition("::")[2] not in _functions(test.partition("::")[0])
    ]
    assert not missing
    assert all(claim["premise"] and claim["broken_by"] for claim in table()["claim"])


def test_sentences_are_found_however_they_are_written() -> None:
    python = '''
def f(x):
    """It is always stable."""
    raise ValueError(f"no {x} at all")
    print(f"margin at {x:.3g}: " "at least twice")
    return g(x, title="never stable" if x else "not a claim here")
'''
    assert [s for s in collect.of_python(python) if collect.claims(s)] == [
        "margin at {}: at least twice",
        "never stable",
    ]
    script = """
// all is stable
const said = f(`${a ? `energy of ${b} generated` : 'nothing is "felt"'}, at most ${{ c: 1 }.c} mJ`,
  "steady \\
hand"); // no margin
"""
    assert [*collect.of_script(script)] == [
        "{}, at most {} mJ",
        "energy of {} generated",
        'nothing is "felt"',
        "steady hand",
    ]
    page = '<p title="All is at\n  rest">No hand &amp; <b>no margin</b> {{x}}</p>'
    assert [*collect.of_page(page)] == ["All is at rest", "No hand &", "no margin"]
    assert not collect.claims("stable")  # a word alone is none


@cache
def _functions(file: str) -> set[str]:
    path = collect.ROOT / file
    tree = ast.parse(path.read_text(encoding="utf-8")) if path.is_file() else ast.parse("")
    return {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}
