"""Errors a user can act on."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable
from typing import Final

_BRACKETS: Final = re.compile(r"\((?:[^()]|\([^()]*\))*\)|\[[^\[\]]*\]")


class UserError(Exception):
    """Bad input: one line that says what is wrong, where, and what would be right. The command line exits 2."""


class PictureError(UserError):
    """What is wrong with a picture, without the name of its file."""


class CellError(Exception):
    """A single cell cannot give a valid score (saturated capture, failed registration): a visible hole."""


class BudgetError(CellError):
    """A method asked the display for more captures than it may use."""


class ForeignError(CellError):
    """What a method raised in its process, under the name of a class that is not of this package."""


class StopError(UserError):
    """The run cannot go on, whatever cell comes next; once its cause is mended, the same command resumes."""


class LostDeviceError(StopError):
    """A device does not answer any more: no further cell of the run would get its photograph."""


class StorageError(StopError):
    """A file cannot be written: the disk is full, or the folder cannot be written to."""


class Pending(BaseException):
    """A photograph was asked for that somebody still has to take: the cell waits, it has not failed.

    Not an `Exception`, so that a method which catches those cannot go on without the photograph.
    """


def reason(error: BaseException) -> str:
    """What failed, in one line of at most 300 characters that any file can hold.

    The name of its class stands before an error of Python, of a library or of a user's code. Errors of this package
    are sentences, and go without.
    """
    own = isinstance(error, UserError | CellError) and not isinstance(error, ForeignError)
    text = str(error) if own else f"{type(error).__name__}: {error}"
    return one_line(text.encode("utf-8", "backslashreplace").decode())[:300] or "no reason given"  # names of files


def one_line(text: str) -> str:
    """A text in one line, with question marks in the place of signs that a terminal would obey."""
    return printable(" ".join(text.split()))


def printable(text: str) -> str:
    """A text with question marks in the place of line ends and of signs that a terminal would obey."""
    return "".join(sign if sign.isprintable() else "?" for sign in text)


def out_of_memory(error: BaseException) -> bool:
    """Whether memory is used up, in NumPy, in Python or in torch, which has no class of its own for it on a CPU."""
    texts = "DefaultCPUAllocator", "can't start new thread"
    return isinstance(error, MemoryError) or any(text in str(error) for text in texts)


def suggest(word: str, allowed: Iterable[str]) -> str:
    """``"did you mean 'x'? "`` for a near miss, then the allowed words; for the end of an error line."""
    words = sorted(allowed)
    near = difflib.get_close_matches(word, words, n=1, cutoff=0.6)
    hint = f"did you mean '{near[0]}'? " if near else ""
    return f"{hint}allowed: {listed(words)}"


def listed(names: Iterable[str], last: str = "") -> str:
    """``a, b, c``; ``a, x; b`` where a name itself holds a comma, unless in brackets. last: a word before the last."""
    parts = list(names)
    between = "; " if any("," in _BRACKETS.sub("", part) for part in parts) else ", "
    if not last or len(parts) < 2:
        return between.join(parts)
    return f"{between.join(parts[:-1])}{between.rstrip(', ')} {last} {parts[-1]}"
