"""Photographs that somebody took, in folders: read, aligned and scored."""

from ...core.io import file_name

FILES = "files"  # the measure of pictures from files, and the name of their data set


def alignment_name(method: str, target: str) -> str:
    """The file of the picture of a capture's alignment."""
    return f"alignment-{file_name(method)}-{file_name(target)}.jpg"
