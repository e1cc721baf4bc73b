"""Small copies of pictures, which a report keeps where the records are not: a clone shows them without computing."""

from __future__ import annotations

import io
from pathlib import Path

from PIL import Image

from ...core.io import write_atomically
from ..section import Report
from .pictures import files, groups, planned

MOST_BYTES = 3_000_000  # of all pictures of a report
QUALITY = 85  # of WebP, 0 to 100: a sixth of the bytes of PNG
MARK, SAYS = "README.md", b"Small copies of the pictures of the report beside this folder, written with it.\n"


def keep_copies(report: Report) -> None:
    """Copy the thumbnails that answer most into ``pictures``, as WebP; those of an earlier run go.

    Nothing changes where a report is written again without its records, nor in a folder that is somebody else's.
    """
    folder = report.thumbnails.copies
    is_ours = not folder.exists() or ((folder / MARK).is_file() and (folder / MARK).read_bytes() == SAYS)
    if not report.thumbnails.store.folder.is_dir() or not is_ours:
        return
    known, kept, room = files(report, planned(report)), dict[str, bytes](), MOST_BYTES
    by_target = ([cell for cell in known if cell[2] == target] for target in report.results.targets)
    for group in [*groups(report), *by_target]:
        paths = {path.stem: path for cell in group if (path := known.get(cell)) and path.stem not in kept}
        new = {stem: content for stem, path in paths.items() if (content := _encoded(path))}
        if (size := sum(map(len, new.values()))) <= room:
            kept, room = kept | new, room - size
    if kept:
        write_atomically(folder / MARK, SAYS)
    for old in folder.glob("*.webp"):
        if old.stem not in kept:
            old.unlink()
    for stem, content in kept.items():
        write_atomically(folder / f"{stem}.webp", content)


def _encoded(path: Path) -> bytes:
    """A picture as WebP; a copy as it is, and nothing of a damaged file."""
    if path.suffix == ".webp":
        return path.read_bytes()
    encoded = io.BytesIO()
    try:
        with Image.open(path) as picture:
            picture.save(encoded, "WEBP", quality=QUALITY)
    except (OSError, ValueError, Image.DecompressionBombError):
        return b""
    return encoded.getvalue()
