"""Sentences about scored captures that a reader of the scores would doubt, had they seen the pictures."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from ...imaging.align import ALIKE_IN_POSE, is_same_mirrored
from ...lab.photograph import MOST_SATURATED
from ..store import Record
from .files import Folders, named

NEARLY_ITSELF = 40.0  # dB: the noise of a good camera alone leaves less
# Of white; constant light of so much leaves 26 dB. Real captures (Stanford 2021) have 2 to 5 %, simulated displays but
# the hazy leto-2020 less than 2 %, and a black level of 6 % of full scale gives 3 to 17 %.
LIFTED = 0.05
ABOVE_CONSTANT = 20.0  # dB: in a target that is nearly black, every picture of it has a high PSNR


def doubts(records: Sequence[Record], folders: Folders, domain: str) -> Iterator[str]:
    """Sentences about what the scores of ``records`` do not show. domain: of the PSNR."""
    done = [record for record in records if record.state == "done"]
    captures = [record for record in done if record.capture["capture_sha256"]]
    psnr = f"psnr_{domain}"
    constant = {record.target: record.values()[psnr] for record in done if record.label == "floor_constant"}
    least = {target: max(NEARLY_ITSELF, value + ABOVE_CONSTANT) for target, value in constant.items()}
    if near := [_name(record) for record in captures if record.values()[psnr] > least[record.target]]:
        yield f"Nearly the target itself, which a photograph with sensor noise is not: {named(near)}."
    yield from _mirrored(captures, folders)
    lifted = {_name(record): record.values().get("darkest", 0.0) for record in captures}
    if bright := [f"{name} {value:.0%}" for name, value in lifted.items() if value > LIFTED]:
        yield (
            f"Bright where the target is darkest, by more than {LIFTED:.0%} of its white: {named(bright)}. Haze and "
            "stray light of the display do that; so does a camera's black level, which can turn the order of methods. "
            "If the files still have one, take it off with --dark FILE|LEVEL."
        )
    if clipped := [record for record in captures if (record.saturated or 0) > MOST_SATURATED]:
        shares = named([f"{_name(record)} {record.saturated:.2%}" for record in clipped])
        yield f"Clipped, with more than {MOST_SATURATED:.1%} of the scored samples at full scale: {shares}."
    given = [record for record in captures if record.capture["geometry"]["kind"] == "given"]
    if unlike := [record for record in given if record.capture["geometry"]["correlation"] < ALIKE_IN_POSE]:
        correlations = named([f"{_name(record)} {record.capture['geometry']['correlation']:.2f}" for record in unlike])
        yield f"Not alike pixel to pixel, with correlations below {ALIKE_IN_POSE:g}: {correlations}."


def _mirrored(captures: Sequence[Record], folders: Folders) -> Iterator[str]:
    """A sentence for each size of capture of which some are mirrored and most are not, or the reverse."""
    sessions: dict[tuple[int, int], Mapping[bool, list[Record]]] = {}
    for record in captures:
        height, width = record.capture["panel"]
        # The sign of the determinant at any point in front of the camera is that of the whole homography.
        mirrored = bool(np.linalg.det(np.array(record.capture["geometry"]["homography"])) < 0)
        sessions.setdefault((width, height), {True: [], False: []})[mirrored].append(record)
    for (width, height), sides in sessions.items():
        fewer = sides[len(sides[True]) <= len(sides[False])]
        if odd := [record for record in fewer if not is_same_mirrored(folders.targets[record.target].load())]:
            yield (
                f"Mirrored against the other captures of {width} x {height} pixels, though one camera sees all "
                f"or none so: {named([_name(record) for record in odd])}."
            )


def _name(record: Record) -> str:
    return f"{record.label}/{record.target}"
