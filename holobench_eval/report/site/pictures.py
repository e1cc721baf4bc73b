"""The pictures of a folder: checked before they are decoded, and those of others written anew.

A picture written anew holds pixels and nothing else: no metadata, and nothing behind its end.
"""

from __future__ import annotations

import io
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from PIL import Image, UnidentifiedImageError

from ...core.errors import UserError
from ..data.tables import DONE
from ..markdown import FIGURE, TEXTS
from ..page.html import plain
from .html import slug
from .intake import MOST_FILE, Source, text_of

FIGURES, THUMBNAILS = "figures", "thumbnails"
SUFFIXES = {".png": "PNG", ".jpg": "JPEG", ".jpeg": "JPEG"}
MODES = ("1", "L", "LA", "P", "PA", "RGB", "RGBA", "CMYK")  # of 8 bits a channel
MOST_PIXELS = 40_000_000
LONGEST_THUMBNAIL = 1024  # pixels
MOST_THUMBNAILS = 400  # of a folder
ROOM = 1_200_000  # bytes of the figures of a study; the others stay in its folder
# Which figures are taken first: what answers, then what is looked at, then charts.
ORDER = ("answer-*", "error-budget*", "quality-paired-*", "quality-*", "*")
STAGES = "stages-"


@dataclass(frozen=True)
class Picture:
    """A picture of the site. path: below the site; caption: what it shows, as text; of: the name of the method whose
    capture it is, or a figure's name in its folder."""

    path: str
    caption: str
    content: bytes
    width: int
    height: int
    of: str


def thumbnails(source: Source, study: str) -> list[Picture]:
    """The captures that a folder shows: ``thumbnails/CELL.png``, CELL as in records.csv, captioned by its row.

    study: the name of its page.
    """
    folder = source.folder / THUMBNAILS
    files = list(_files(folder))
    if len(files) > MOST_THUMBNAILS:
        raise UserError(f"{folder}: {len(files)} pictures; expected at most {MOST_THUMBNAILS}")
    done = source.results.frame[source.results.frame["state"] == DONE]
    rows = {str(row["cell"]): row for _, row in done.iterrows()}
    found = []
    for path in files:
        row = rows.get(path.stem)
        if row is None:
            raise UserError(
                f"{path}: no such cell; a thumbnail is named by the column 'cell' of a done row of records.csv"
            )
        caption = f"{row['label']} on {row['condition']}, {row['target']}"
        found.append(_picture(path, f"{study}/captures", caption, str(row["method"]), LONGEST_THUMBNAIL, anew=True))
    return found


def figures(source: Source, study: str) -> tuple[list[Picture], list[Picture], int]:
    """The figures of a folder that fit ``ROOM``, the stage sheets of its displays, and how many figures are left."""
    files = list(_files(source.folder / FIGURES))
    charts = [path for path in files if not path.name.startswith(STAGES)]
    sheets = [path for path in files if path.name in {f"{STAGES}{name}.png" for name in source.results.conditions}]
    texts = "\n".join(text_of(source.folder / name) for name in TEXTS)
    captions = {name: plain(caption) for name, caption in FIGURE.findall(texts)}
    taken, room = list[Path](), ROOM
    for path in dict.fromkeys(path for pattern in ORDER for path in charts if path.match(pattern)):
        if path.stat().st_size <= room:
            taken.append(path)
            room -= path.stat().st_size
    made = [
        _picture(path, study, captions.get(path.name, path.stem.replace("-", " ")), path.stem, None, bool(source.by))
        for path in (*taken, *sheets)
    ]
    return made[: len(taken)], made[len(taken) :], len(charts) - len(taken)


def _files(folder: Path) -> Iterator[Path]:
    """The pictures of a folder by name, each a file of its own of a format and size that are taken."""
    if folder.is_symlink() or (folder.exists() and not folder.is_dir()):
        raise UserError(f"{folder}: not a folder of its own; expected one with PNG or JPEG files")
    for path in sorted(folder.iterdir()) if folder.exists() else ():
        if not path.name.isprintable():
            raise UserError(f"{folder}: the file name {path.name!r}; expected characters that can be seen, rename it")
        if path.is_symlink() or not path.is_file():
            raise UserError(f"{path}: a link or a folder; expected PNG or JPEG files alone, copied into this folder")
        if path.suffix.lower() not in SUFFIXES:
            raise UserError(f"{path}: not a PNG or JPEG; expected pictures alone, take it out")
        if path.stat().st_size > MOST_FILE:
            raise UserError(f"{path}: more than {MOST_FILE // 10**6} MB; save it smaller")
        yield path


def _picture(path: Path, study: str, caption: str, of: str, longest: int | None, anew: bool) -> Picture:
    """A decoded picture. longest: of its sides [px]; anew: whether it is written again."""
    form = SUFFIXES[path.suffix.lower()]
    try:
        with Image.open(path, formats=(form,)) as picture:
            width, height = picture.size
            if width * height > MOST_PIXELS or max(width, height) > (longest or MOST_PIXELS):
                limit = f"{longest} pixels a side" if longest else f"{MOST_PIXELS // 10**6} million pixels"
                raise UserError(f"{path}: {width} x {height} pixels; expected at most {limit}")
            if anew and picture.mode not in MODES:
                raise UserError(f"{path}: more than 8 bits a channel; expected 8, save it again")
            picture.load()
            content = _written(picture, form) if anew else path.read_bytes()
    except (UnidentifiedImageError, OSError, SyntaxError, ValueError, Image.DecompressionBombError) as error:
        raise UserError(f"{path}: not a whole {form} ({error}); save it again") from None
    return Picture(f"pictures/{study}/{slug(path.stem)}{path.suffix.lower()}", caption, content, width, height, of)


def _written(picture: Image.Image, form: str) -> bytes:
    text = io.BytesIO()
    plain = picture.convert("L" if picture.mode in ("1", "L") else "RGB")
    plain.info.clear()
    plain.save(text, format=form, **({"quality": 92} if form == "JPEG" else {"optimize": False}))
    return text.getvalue()
