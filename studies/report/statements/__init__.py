"""All statements of the report, chapter by chapter, compared with what runs and equations give."""

from __future__ import annotations

from studies.report.report_page import Runs
from studies.report.statements import (
    appendix_matrices,
    dynamics,
    experiment,
    introduction,
    mobility,
    paper_experiment,
    paper_method,
    rendering,
)
from studies.report.statements.statement import Statement

CHAPTERS = (
    introduction,
    dynamics,
    rendering,
    mobility,
    experiment,
    appendix_matrices,
    paper_method,
    paper_experiment,
)


def every_statement(runs: Runs) -> list[Statement]:
    """Those of all chapters in the report's order."""
    return [statement for chapter in CHAPTERS for statement in chapter.statements(runs)]
