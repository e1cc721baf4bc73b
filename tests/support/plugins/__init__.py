"""Methods and data sets as users bring them: files that tests copy beside their configs."""

from pathlib import Path


def text(name: str) -> str:
    """What one of the files here holds."""
    return (Path(__file__).parent / f"{name}.py").read_text()
