"""Sentences about scored captures that a reader of the scores would doubt, had they seen the pictures."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from ...imaging.align import ALIKE_IN_POSE, is_same_mirrored
from ...lab.photograph import MOST_SATURATED
from ..store import Record
from .files import Folders, named
from .pictures import Picture

NEARLY_ITSELF = 40.0  # dB: the noise of a good camera alone leaves less
# Of white; constant light of so much leaves 26 dB. Real captures (Stanford 2021) have 2 to 5 %, simulated displays but
# leto-hazy less than 2 %, and a black level of 6 % of full scale gives 3 to 17 %.
LIFTED = 0.05
ELSEWHERE = 0.75  # target pixels; below, what interpolation does to noise is most of a difference in dB
MATTERS = 0.2  # dB, by which what stands out alone changes a score; independent noise that looks so changes it by 0.17
NOISE = 1.25  # of the darkest hundredth of a capture, which noise puts below its black level
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
    if bright := [record for record in captures if record.values().get("darkest", 0.0) > LIFTED]:
        bright.sort(key=lambda record: -record.values()["darkest"])
        shares = named([f"{_name(record)} {record.values()['darkest']:.0%}" for record in bright])
        first = folders.captures[bright[0].label, bright[0].target]
        linear = "" if bright[0].capture["values"] == "linear" else "save linear counts and "
        remedy = "" if first.dark else f" If the files still have one, {linear}take it off with --dark FILE|LEVEL."
        yield (
            f"Bright where the target is darkest, by more than {LIFTED:.0%} of its white{_although(first)}: "
            f"{shares}. Haze and stray light of the display do that; so does a camera's black level, which can turn "
            f"the order of methods.{remedy}"
        )
    if dim := [
        record
        for record in captures
        if record.values().get("darkest", 0.0) < -LIFTED
        and (record.capture["values"] == "linear" or folders.captures[record.label, record.target].dark is not None)
    ]:
        shares = named([f"{_name(record)} {-record.values()['darkest']:.0%}" for record in dim])
        yield (
            f"Darker than the target where it is darkest, by more than {LIFTED:.0%} of its white: {shares}. Dark "
            "counts that are too high do that, and can turn the order of methods: look at a frame without light."
        )
    if clipped := [record for record in captures if (record.saturated or 0) > MOST_SATURATED]:
        shares = named([f"{_name(record)} {record.saturated:.2%}" for record in clipped])
        yield f"Clipped, with more than {MOST_SATURATED:.1%} of the scored samples at a highest value: {shares}."
    yield from _odd(captures, folders, psnr)
    if moved := [
        (record, v) for record in captures if (v := record.values()).get("second_aligner_px", 0.0) > ELSEWHERE
    ]:
        seconds = named([f"{_name(record)} {v[f'{psnr}_second']:.2f} dB for {v[psnr]:.2f}" for record, v in moved])
        yield f"A second aligner finds the target elsewhere, by more than {ELSEWHERE:g} of its pixels: {seconds}."
    given = [record for record in captures if record.capture["geometry"]["kind"] == "given"]
    if unlike := [record for record in given if record.capture["geometry"]["correlation"] < ALIKE_IN_POSE]:
        correlations = named([f"{_name(record)} {record.capture['geometry']['correlation']:.2f}" for record in unlike])
        yield f"Not alike pixel to pixel, with correlations below {ALIKE_IN_POSE:g}: {correlations}."


def _odd(captures: Sequence[Record], folders: Folders, psnr: str) -> Iterator[str]:
    """A sentence about captures whose scores depend on what a camera does and light does not."""
    scores = [(record, record.values()) for record in captures]
    gains = [(v[f"{psnr}_mended"] - v[psnr], record, v) for record, v in scores if f"{psnr}_mended" in v]
    odd = sorted((one for one in gains if one[0] > MATTERS / 4), key=lambda one: -one[0])
    if not odd or odd[0][0] <= MATTERS:
        return
    without = [f"{_name(r)} {v[psnr] + gain:.2f} dB for {v[psnr]:.2f} ({v['odd_pixels']:.0f})" for gain, r, v in odd]
    dark = folders.captures[odd[0][1].label, odd[0][1].target].dark
    linear = "" if odd[0][1].capture["values"] == "linear" else "save linear counts and "
    remedy = f" To take hot ones off, {linear}give a dark frame and no level: --dark FILE."
    remedy = "" if dark and dark.bias.size > 1 else remedy
    yield (
        "Pixels, rows or columns stand out from all around them, as hot, dead and mosaic ones of a camera do and light "
        f"does not. They can turn the order of methods. PSNR without them, and how many: {named(without)}.{remedy}"
    )


def _although(picture: Picture) -> str:
    """What was taken off a capture that is bright in the dark all the same; empty where nothing was.

    Counts of 12 bits at the upper end of 16 are 16 times those that the camera's own software shows.
    """
    if picture.dark is None:
        return ""
    taken, darkest = float(picture.dark.bias.mean()), float(np.percentile(picture.load(), 1)) * picture.white
    larger = taken * picture.step
    asked = f": is it {larger:g}?" if taken < larger < NOISE * darkest else ""
    rest = f" (the files count in steps of {picture.step}{asked})" if picture.step > 1 else ""
    return f", although --dark took {taken:g} counts off{rest}"


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
