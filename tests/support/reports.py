"""A report as its readers have it: report.md, then details.md."""

from pathlib import Path

from holobench_eval.report import Results
from holobench_eval.report.board import texts


def whole(report: Path) -> str:
    """The text of both files. report: the path of report.md."""
    return report.read_text() + report.with_name("details.md").read_text()


def files(folder: Path) -> dict[str, bytes]:
    """What is in the files below a folder, by path."""
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def write_texts(results: Results, folder: Path) -> None:
    """Write the files of data of a report."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in texts(results).items():
        (folder / name).write_text(text)
