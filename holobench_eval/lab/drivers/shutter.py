"""The shutter speeds of a camera as it writes them: ``1/125``, ``0.5``, ``30``, ``0.0100s``, ``1"3``, ``bulb``."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable

FRACTION = re.compile(r"(\d+(?:\.\d+)?)\s*/\s*(\d+(?:\.\d+)?)")
QUOTED = re.compile(r"(\d+)\"(\d+)?")  # 1"3 is 1.3 s
LARGEST_SPREAD = 0.2  # of a step: cameras that write 1/60 and 0.3 have 0.06 to 0.18, any times at all have 0.29
PLAIN = re.compile(r"(\d+(?:[.,]\d+)?)")


def seconds(text: str) -> float | None:
    """The time [s] that a shutter speed stands for; None for ``bulb``, ``auto`` and whatever else is no time."""
    word = re.sub(r"\s*s(ec(onds?)?)?\.?$", "", text.strip(), flags=re.IGNORECASE).strip()
    if match := FRACTION.fullmatch(word):
        value = float(match[1]) / float(match[2]) if float(match[2]) else 0.0
    elif match := QUOTED.fullmatch(word):
        value = float(f"{match[1]}.{match[2] or 0}")
    elif match := PLAIN.fullmatch(word):
        value = float(match[1].replace(",", "."))
    else:
        return None
    return value if 0 < value < math.inf else None


def speeds(choices: Iterable[str]) -> dict[float, str]:
    """Time [s] to the camera's own word for it, shortest first, without what is no time."""
    words = {time: choice for choice in choices if (time := seconds(choice)) is not None}
    return dict(sorted(words.items()))


def nearest(times: Iterable[float], wanted: float) -> float:
    """The time with the smallest ratio to the wanted one."""
    return min(times, key=lambda time: abs(math.log(time / wanted)))


def exact(speeds: Iterable[float]) -> dict[float, float]:
    """What a camera's written times [s] really are: its shutter runs in exact halves or thirds of a stop.

    So 1/60 s is 1/64 s, 30 s are 32 s, and taking the written times would make a linear sensor look bent by 6 %. Which
    steps a camera has is seen from its whole list; a list that fits neither is taken at its word.
    """
    written = list(speeds)
    stops = [math.log2(time) for time in written]
    spread = {parts: _spread([stop * parts for stop in stops]) for parts in (1, 2, 3)}
    parts = min(spread, key=lambda part: spread[part])
    if spread[parts] > LARGEST_SPREAD:
        return {time: time for time in written}
    return {time: 2.0 ** (round(stop * parts) / parts) for time, stop in zip(written, stops, strict=True)}


def _spread(values: list[float]) -> float:
    """RMS distance from whole numbers."""
    return math.sqrt(sum((value - round(value)) ** 2 for value in values) / max(len(values), 1))
