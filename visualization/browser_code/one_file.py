"""A page as one HTML file, which opens without a network: styles, scripts and data within it."""

from __future__ import annotations

import base64
import gzip
import json
import re
from collections.abc import Iterator, Mapping
from html import escape
from pathlib import Path
from typing import Any
from urllib.parse import quote

PAGE = Path(__file__).parent
POLICY = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data:"
"""Content security policy of the file: what is in it, and nothing from elsewhere."""
IMPORT = re.compile(r'^import \{ (.+?) \} from "\./(\w+\.js)";$', re.MULTILINE)
COMMENT = re.compile(r"^ *//.*\n", re.MULTILINE)
EXPORT = re.compile(r"^export (?=(?:class|function|const) (\w+))", re.MULTILINE)


def page(name: str, texts: Mapping[str, str], policy: str = POLICY) -> str:
    """The page `name` of the folder `page`, with `texts` in elements by these names."""
    html = (PAGE / name).read_text(encoding="utf-8")
    tag = f'<meta http-equiv="Content-Security-Policy" content="{escape(policy)}">'
    html = html.replace('<meta charset="utf-8">', f'<meta charset="utf-8">\n{tag}', 1)
    html = re.sub(r'<link rel="icon" href="(.+?)">', _icon, html)
    sheets = re.compile(r'<link rel="stylesheet" href="(.+?)">\n?')
    kept = "".join(_element(name, text) for name, text in texts.items())
    kept += _element("style", pack_text("".join(map(_text, sheets.findall(html))).encode()))
    return re.sub(
        r'<script type="module" src="(.+?)"></script>',
        lambda found: kept + _element("script", pack_text(bundle(found[1]).encode())) + LOADER,
        sheets.sub("", html),
    )


def _element(name: str, text: str) -> str:
    return f'<script type="application/json" id="{name}">{text}</script>\n'


def headers(policy: str) -> dict[str, str]:
    """The headers with which a page is served that nobody may frame, keep or be sent on from."""
    return {
        "Content-Security-Policy": f"{policy}; frame-ancestors 'none'",
        "Referrer-Policy": "no-referrer",
        "X-Content-Type-Options": "nosniff",
        "Cache-Control": "no-store",
    }


def as_json(data: Any) -> str:
    """Text that an element can have: "<" could end it, or begin a comment in it."""
    text = json.dumps(data, separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c")


def pack_text(content: bytes) -> str:
    """Compressed bytes as text of base 85, 6 % shorter than base 64, with "," for "<", which could
    end the element; packed.js unpacks them."""
    return base64.b85encode(gzip.compress(content, 9, mtime=0)).decode().replace("<", ",")


def unpack_text(html: str, element: str) -> bytes:
    """The packed bytes in an element of a page."""
    _, _, rest = html.partition(f'id="{element}">')
    return gzip.decompress(base64.b85decode(rest.partition("</script>")[0].replace(",", "<")))


def bundle(name: str) -> str:
    """A module of the page with those that it imports, each a function that returns what it
    exports, in the order in which they need each other; it comes last, and as it is."""
    *needed, last = _order_modules(name, [])
    wrapped = (f"const {_variable(n)} = (() => {{\n{_module(n)}{_end(n)}}})();\n" for n in needed)
    return "".join([*wrapped, _module(last)])


def _order_modules(name: str, before: list[str]) -> list[str]:
    """The modules `before`, then those that a module needs and they lack, then the module."""
    for needed in _needs(name):
        before = before if needed in before else _order_modules(needed, before)
    return [*before, name]


def _needs(name: str) -> Iterator[str]:
    yield from (found[2] for found in IMPORT.finditer(_text(name)))


def _module(name: str) -> str:
    text = COMMENT.sub("", _text(name))
    text = IMPORT.sub(lambda found: f"const {{ {found[1]} }} = {_variable(found[2])};", text)
    return EXPORT.sub("", text)


def _end(name: str) -> str:
    """The statement by which a module returns what it exports."""
    return f"return {{ {', '.join(EXPORT.findall(_text(name)))} }};\n"


def _variable(name: str) -> str:
    return f"${name.removesuffix('.js')}"


def _text(name: str) -> str:
    return (PAGE / name).read_text(encoding="utf-8")


def _icon(match: re.Match[str]) -> str:
    return f'<link rel="icon" href="data:image/svg+xml,{quote(_text(match[1]))}">'


LOADER = f"""<script type="module">
{bundle("packed.js")}
const script = document.createElement("script");
script.type = "module";
script.textContent = await unpackedText("script");
const style = document.createElement("style");
style.textContent = await unpackedText("style");
document.head.append(style, script);
</script>"""
"""Styles the page and runs its script, which are compressed, too."""
