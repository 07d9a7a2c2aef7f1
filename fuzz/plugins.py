"""Plugins that fail in every way that Python has, and names that are none."""

from __future__ import annotations

from collections.abc import Iterator

from fuzz.cases import Made, seeded
from fuzz.commands import Place
from fuzz.processes import own_folder

FAILURES = (
    "raise RuntimeError('broken')",
    "raise BaseException('broken')",
    "raise KeyboardInterrupt",
    "raise SystemExit(0)",
    "raise SystemExit",
    "raise GeneratorExit",
    "raise BaseExceptionGroup('x', [KeyboardInterrupt()])",
    "import os; os._exit(0)",
    "import sys; sys.exit(0)",
    "import sys; sys.exit('gone')",
    "exit()",
    "def f(): f()\nf()",
    "x = '",
    "return 1",
    "\0",
    "import no_such_module",
    "from hapticlink import no_such_name",
    "import os; os.chdir('/')",
    "import sys; sys.modules.clear()",
    "import sys; sys.stdout.close()",
    "class E(Exception):\n    def __str__(self): raise ValueError\nraise E",
    "class E(BaseException): pass\nraise E",
    "import warnings; warnings.simplefilter('error')",
    "pass",
    "'\\ud800'.encode()",
)
NAMES = (
    *("../x", "x.py", "/x", "x/y", ".", "..", "", " ", "x y", "\u00fc", "json", "os", "__main__"),
    *("hapticlink", "hapticlink.commands", "x" * 5000, "-", "--", "1", "a..b", ".a", "a."),
)


def attack(number: int, seed: int) -> Iterator[Made]:
    """`number` plugins, every third one a name."""
    with own_folder() as folder:
        place = Place(folder)
        for i, _, draw in seeded(number, seed):
            if named := i % 3 == 2:
                module = draw.choice(NAMES)
            else:
                module = f"plugin_{i}"
                text = "\n".join(draw.choice(FAILURES) for _ in range(draw.choice((1, 1, 2))))
                (place.here / f"{module}.py").write_bytes(text.encode())
            run = draw.choice((["run", "pendulum"], ["info", "pendulum"], ["sweep", "pendulum"]))
            arguments = [*run, "--plugin", module]
            if run[0] == "run":
                arguments += ["--set", "duration=0.05", "--out", str(place.out)]
            outcome, wrong = place.made(arguments)
            if outcome == "done" and not named:
                outcome, wrong = "believed", f"status 0: {text!r}"
            kind = "names" if named else "modules"
            yield Made(kind, ascii(module if named else text)[:200], outcome, wrong)
