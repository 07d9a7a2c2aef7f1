"""What Python packs into a page, its scripts unpack."""

from random import Random

from hapticlink.visualization.browser_code import one_file
from tests.visualization.browser_code.javascript import javascript

UNPACKED = """
globalThis.document = { getElementById: (id) => ({ textContent: given[id] }) };
answer = [];
for (const id of given.keys()) answer.push([...await unpacked(id)]);
"""


def test_bytes_of_all_lengths_come_back() -> None:
    """Lengths after compression leave each remainder of 4."""
    contents = [Random(n).randbytes(n) for n in range(9)]
    texts = [one_file.pack_text(content) for content in contents]
    assert {len(text) % 5 for text in texts} == {0, 2, 3, 4}
    assert "<" not in "".join(texts)
    assert javascript("packed.js", UNPACKED, texts) == [[*content] for content in contents]
    html = f'<script id="a">{texts[5]}</script>'
    assert one_file.unpack_text(html, "a") == contents[5]
