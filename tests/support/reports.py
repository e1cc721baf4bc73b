"""A report as its readers have it: report.md, then details.md."""

from pathlib import Path


def whole(report: Path) -> str:
    """The text of both files. report: the path of report.md."""
    return report.read_text() + report.with_name("details.md").read_text()
