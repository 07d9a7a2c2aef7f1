"""Runs the study: python -m studies.model_hold FOLDER [FOLDER OF ROWS]."""

import sys
from pathlib import Path

from studies.model_hold import study

target = Path(sys.argv[1])
study(target, Path(sys.argv[2]) if len(sys.argv) > 2 else target / "rows")
