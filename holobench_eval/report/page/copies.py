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


def keep_copies(report: Report) -> None:
    """Copy the thumbnails that answer most into ``pictures``, as WebP; those of an earlier run go.

    Nothing changes where a report is written again without its records.
    """
    if not report.thumbnails.store.folder.is_dir():
        return
    known, kept, room = files(report, planned(report)), dict[str, bytes](), MOST_BYTES
    by_target = ([cell for cell in known if cell[2] == target] for target in report.results.targets)
    for group in [*groups(report), *by_target]:
        paths = {path.stem: path for cell in group if (path := known.get(cell)) and path.stem not in kept}
        new = {stem: _encoded(path) for stem, path in paths.items()}
        if (size := sum(map(len, new.values()))) <= room:
            kept, room = kept | new, room - size
    for old in report.thumbnails.copies.glob("*.webp"):
        if old.stem not in kept:
            old.unlink()
    for stem, content in kept.items():
        write_atomically(report.thumbnails.copies / f"{stem}.webp", content)


def _encoded(path: Path) -> bytes:
    encoded = io.BytesIO()
    Image.open(path).save(encoded, "WEBP", quality=QUALITY)
    return encoded.getvalue()
