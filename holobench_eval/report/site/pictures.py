"""The figures of a report on its site: those that fit, what answers first, each decoded once, so that it is whole."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from PIL import Image, UnidentifiedImageError

from ...core.errors import UserError
from ..markdown import captions
from ..page import plain
from .html import slug

ROOM = 1_200_000  # bytes of the figures of a study; the others stay in its folder
# Which figures are taken first: what answers, then what is looked at, then charts.
ORDER = ("answer-*", "error-budget*", "quality-paired-*", "quality-*", "*")
STAGES = "stages-"


@dataclass(frozen=True)
class Picture:
    """A picture of the site. path: below the site; caption: what it shows, as text; of: its name in its folder."""

    path: str
    caption: str
    content: bytes
    width: int
    height: int
    of: str


def figures(folder: Path, displays: Sequence[str], study: str) -> tuple[list[Picture], list[Picture], int]:
    """The figures of a report that fit ``ROOM``, the stage sheets of its displays, and how many figures are left.

    study: the name of its page.
    """
    files = sorted(path for path in folder.glob("figures/*") if path.suffix in (".png", ".jpg"))
    charts = [path for path in files if not path.name.startswith(STAGES)]
    sheets = [path for path in files if path.name in {f"{STAGES}{name}.png" for name in displays}]
    texts = {name: plain(caption) for name, caption in captions(folder).items()}
    taken, room = list[Path](), ROOM
    for path in dict.fromkeys(path for pattern in ORDER for path in charts if path.match(pattern)):
        if path.stat().st_size <= room:
            taken.append(path)
            room -= path.stat().st_size
    made = [_picture(path, study, texts.get(path.name, path.stem.replace("-", " "))) for path in (*taken, *sheets)]
    return made[: len(taken)], made[len(taken) :], len(charts) - len(taken)


def _picture(path: Path, study: str, caption: str) -> Picture:
    try:
        with Image.open(path, formats=("PNG", "JPEG")) as picture:
            picture.load()
    except (UnidentifiedImageError, OSError, SyntaxError, ValueError, Image.DecompressionBombError) as error:
        raise UserError(f"figures/{path.name} is not a whole picture ({error})") from None
    name = f"pictures/{study}/{slug(path.stem)}{path.suffix}"
    return Picture(name, caption, path.read_bytes(), *picture.size, path.stem)
