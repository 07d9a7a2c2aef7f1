"""Writes docs/gallery.md and docs/scenes/<scene>.md, a page for each shipped scene, from the title,
the description and the comment `# Try it` of its file:

python docs/make_scenes.py
"""

from __future__ import annotations

import re
from pathlib import Path

import hapticlink as hl

DOCS = Path(__file__).parent
SCENES = DOCS.with_name("scenes")
TRY = re.compile(r"^# Try it: (.+(?:\n# .+)*?)\n#     (hapticlink .+)$", re.MULTILINE)
GROUPS = {
    "In the hand, with device, controller and graphics": lambda scene: scene.device,
    "Mechanisms alone": lambda scene: not scene.device,
}


def pages() -> dict[Path, str]:
    """The text of every page by its path."""
    found = {DOCS / "scenes" / f"{name}.md": page(name) for name in hl.shipped()}
    return {DOCS / "gallery.md": gallery(), **found}


def page(name: str) -> str:
    """The page of a scene."""
    scene, text = hl.scene(name), (SCENES / f"{name}.toml").read_text(encoding="utf-8")
    tried = TRY.search(text)
    assert tried, f"{name}.toml has no comment `# Try it`"
    effect = tried[1].replace("\n# ", " ")
    base = re.match(r'extends = "(.+)"', text)
    over = f" It extends [`{base[1]}`]({base[1]}.md)." if base else ""
    return f"""# {scene.title}

![{scene.title}, at the start](../pictures/{name}.png)

{scene.description.strip()}

```sh
hapticlink run {name}
hapticlink view {name}
```

**Try it.** {effect[0].upper()}{effect[1:]}

```sh
{tried[2]}
```

The scene is [`scenes/{name}.toml`](../../scenes/{name}.toml).{over}
`hapticlink info {name} --draw` draws its blocks and connections; a scene of your own starts
with `extends = "{name}"` ([your own linkage](../own-linkage.md)). Sections, tables and
figures are those of [the report](../glossary.md).
"""


def gallery() -> str:
    """The page of all scenes."""
    lines = [
        "# Shipped scenes",
        "Each runs by its name, `hapticlink run closed-loop`, and can be dragged with the mouse,\n"
        "`hapticlink view closed-loop`. The pictures show the start poses.",
    ]
    for title, belongs in GROUPS.items():
        lines.append(f"## {title}")
        rows = ["| scene | | |", "|---|---|---|"]
        for name, shown in hl.shipped().items():
            if belongs(hl.scene(name)):
                picture = f"[![{name}](pictures/{name}.png)](scenes/{name}.md)"
                rows.append(f"| [`{name}`](scenes/{name}.md) | {picture} | {shown} |")
        lines.append("\n".join(rows))
    entries = "\n".join(f"scenes/{name}" for name in hl.shipped())
    lines.append(f"```{{toctree}}\n:hidden:\n\n{entries}\n```")
    return "\n\n".join(lines) + "\n"


if __name__ == "__main__":
    (DOCS / "scenes").mkdir(exist_ok=True)
    for path, text in pages().items():
        path.write_text(text, encoding="utf-8")
        print(path)
