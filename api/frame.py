"""Tables as pandas frames, where pandas is installed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from hapticlink.fmus.versions import install_command
from hapticlink.orchestrator.base.errors import InputFault

if TYPE_CHECKING:
    import pandas as pd


def frame(columns: Mapping[str, Any], index: str | None = None) -> pd.DataFrame:
    """A frame of `columns` whose index is the column `index`. Raises InputFault if pandas is not
    installed."""
    try:
        import pandas as pd
    except ImportError:
        raise InputFault(f"frame() needs pandas: {install_command('pandas')}") from None
    made = pd.DataFrame(dict(columns))
    return made.set_index(index) if index else made
