"""The alignments, scores and pictures that ``holoeval score`` computes from captures and keeps."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from ...core.device import return_large_arrays
from ...core.errors import CellError
from ...core.hashing import digest
from ...core.io import write_atomically
from ...imaging.align import Alignment, align, confirmed, gray
from ...imaging.cross_check import disagreement, second_warp
from ...imaging.shared_pose import sampled, shared
from ...imaging.similarity import reduced, similarity
from ...imaging.warp import Warp
from ...lab.photograph import MOST_SATURATED
from ...metrics import catalogue, floor_captures, match, score
from ...metrics.protocol import VERSION
from ...optics.colour import srgb_decode, srgb_encode
from .. import identity
from ..plan import FLOORS, REFERENCE
from ..running import provenance
from ..scoring.pictures import write_thumbnail
from ..store import Record, Scores, Store
from ..versions import ALIGNMENT, HARNESS
from . import FILES, alignment_name
from .exposure import burnt, darkest
from .files import Folders, Key
from .pairing import exchange, too_few_levels
from .pictures import Values
from .sensor import clipped, mended
from .visible import LEAST, Part, cropped, largest_part, part_of, share, shown

LARGE = 2**21  # pixels of a target, those of 1080 x 1920
WIDE = 2048  # pixels of a target's longer side to which the second aligner, of which 0.1 px is asked, reduces it
SLOW = ("flip", "mofd", "lpips", "haarpsi")  # how their names begin: the floor of a `LARGE` target has none of them
CONDITION = "photographed display"

Alignments = dict[Key, Alignment | str]  # or the reason of a refusal
Step = Callable[[str], None]  # called with the name of each step
Draw = Callable[[Path, Values, Warp, Values, Values], None]  # file, capture, warp, matched capture, target


def described(folders: Folders, values: str, dark: str = "") -> dict[str, Any]:
    """Everything about the present scoring of pictures for their ``provenance.json``."""
    files = {f"captures/{'/'.join(key)}": picture.sha256 for key, picture in folders.captures.items()}
    files |= {f"targets/{name}": picture.sha256 for name, picture in folders.targets.items()}
    code = {"metrics": HARNESS, "alignment": ALIGNMENT}
    given = {"code_sha256": code, "files": files, "values": values} | ({"dark": dark} if dark else {})
    return given | provenance.software()


@dataclass(frozen=True)
class Scoring:
    """Captures from folders, and how they are scored.

    store: of records, alignments and pictures; values: how files are read, ``stored`` (as they are), ``srgb``, or
    ``linear`` (captures as linear light); draw: draws an alignment from display-encoded values; visible: score the part
    of a target that all its captures show, if that is half of it; aligned: captures lie on their targets already; dark:
    what tells the dark counts that are taken off captures from others, empty for none.
    """

    folders: Folders
    store: Store
    values: str
    lpips_weights: str | None
    draw: Draw
    visible: bool = False
    aligned: bool = False
    dark: str = ""

    @property
    def domain(self) -> str:
        """The domain of PSNR and SSIM in the scores' names."""
        return "stored" if self.values == "stored" else "linear"

    @cached_property
    def metrics(self) -> dict[str, str]:
        """The version of every score that can be computed here, by its name."""
        weights = None if self.lpips_weights is None else Path(self.lpips_weights)
        here = [metric.name for metric in catalogue(weights) if metric.available() is None]
        return identity.versions_of((*here, identity.SPECKLE, identity.MATCH, identity.REFINED), weights)

    def records(self, step: Step) -> list[Record]:
        """A record for every method and target, and for the floor of targets that are found in some capture.

        Old pictures of alignments go.
        """
        if any(math.prod(target.shape[1:]) > LARGE for target in self.folders.targets.values()):
            return_large_arrays()
        own = self.alignments(step)
        placements = own if self.aligned else {**own, **self.common(own)}
        parts = self.parts(placements) if self.visible else {}
        records = []
        found = {key[1] for key, alignment in placements.items() if isinstance(alignment, Alignment)}
        for name in self.folders.targets:
            step(f"floor of {name}")
            records += self.floor(name, parts.get(name)) if name in found else []
        keys = [(method, name) for method in self.folders.methods for name in self.folders.targets]
        for key in keys:
            if key in self.folders.captures:
                step(f"scoring {key[0]}, {key[1]}")
            is_shared = key in placements and placements[key] != own[key]
            kind = "given" if self.aligned else "shared" if is_shared else "own"
            records.append(self.scored(key, placements.get(key), kind, parts.get(key[1])))
        figures = self.store.output / "figures"
        for old in {*figures.glob("alignment-*.jpg")} - {figures / alignment_name(*key) for key in keys}:
            old.unlink()
        return records

    def alignments(self, step: Step) -> Alignments:
        """Every capture's own alignment, kept from an earlier run or computed."""
        own: Alignments = {**self.folders.unread}
        for key, picture in self.folders.captures.items():
            step(f"aligning {key[0]}, {key[1]}")
            pairing = self.folders.pairings[key]
            if pairing.refused or self.aligned:
                own[key] = pairing.refused or self.given(key)
                continue
            files = [picture.sha256, self.folders.targets[key[1]].sha256]
            chosen = [*filter(None, [pairing.channel, "visible" if self.visible else "", self.dark])]
            key_digest = digest([*files, self.values == "linear", ALIGNMENT, *chosen])
            path = self.store.folder / f"alignment-{key_digest}.json"
            found = _read(path)
            if found is None:
                capture, target = self.loaded(key)
                try:
                    found = align(self.viewable(capture), target, self.visible)
                except CellError as error:
                    found = f"{error}{burnt(self.folders.captures[key].load())}"
                plain = {"refused": found} if isinstance(found, str) else found.to_dict()
                write_atomically(path, f"{json.dumps(plain, sort_keys=True, allow_nan=False)}\n".encode())
            own[key] = found
        return own

    def given(self, key: Key) -> Alignment | str:
        """Pixel to pixel, how alike a capture is to its target; or why it is refused."""
        picture, target = self.folders.captures[key].shape[1:], self.folders.targets[key[1]].shape[1:]
        if picture != target:
            sizes = f"{picture[1]} x {picture[0]} pixels and the target {target[1]} x {target[0]}"
            return f"the capture has {sizes}; aligned captures have the size of their target"
        warp = Warp(target, np.eye(3), np.zeros((6, 2)))
        frame, reference = (gray(values) for values in self.loaded(key))
        return Alignment(warp, similarity(frame, reference, warp).overall)

    def loaded(self, key: Key) -> tuple[Values, Values]:
        """A capture, its dark counts taken off, and its target, in the channels that are compared."""
        capture, target = self.folders.captures[key].light(), self.folders.targets[key[1]].load()
        return self.compared(key, capture), self.compared(key, target, is_target=True)

    def compared(self, key: Key, values: Values, is_target: bool = False) -> Values:
        """The channels of a capture or target that are compared."""
        index = self.folders.pairings[key].index
        return values if index is None else values[:1] if is_target else values[index : index + 1]

    def floor_channels(self, name: str) -> int:
        """How many channels of a target its floor has: one where a capture of it is scored on one."""
        single = any(pairing.channel for (_, target), pairing in self.folders.pairings.items() if target == name)
        return 1 if single else self.folders.targets[name].shape[0]

    def viewable(self, values: Values) -> Values:
        """Display-encoded values of a capture, in which it can be compared with its target by eye and by features."""
        if self.values != "linear":
            return values
        bright = max(float(np.percentile(values, 99.5)), 1e-6)
        return srgb_encode(torch.from_numpy(values).clamp_min(0) / bright).numpy()

    def common(self, own: Alignments) -> Alignments:
        """The shared alignments, by frame size and target shape, of captures that agree with one or that it fits."""
        captures, targets = self.folders.captures, self.folders.targets
        groups: dict[tuple[int, ...], list[Key]] = {}
        for key, picture in captures.items():
            if not self.folders.pairings[key].refused:
                groups.setdefault((*picture.shape[1:], *targets[key[1]].shape[1:]), []).append(key)
        placements: Alignments = {}
        for keys in groups.values():
            common = shared({key: alignment for key in keys if isinstance(alignment := own[key], Alignment)})
            if common is None:
                continue
            warp, agreeing = common
            for key in keys:
                if key in agreeing or isinstance(own[key], str):
                    capture, target = self.loaded(key)
                    fit = confirmed(self.viewable(capture), target, warp, self.visible)
                    placements |= {key: fit} if fit is not None else {}
        return placements

    def parts(self, placements: Alignments) -> dict[str, Part]:
        """The part of each target that all its captures show, where it is not all of it.

        Where that is less than `LEAST` of the target, ``placements`` gets a refusal for each of them.
        """
        parts = {}
        for name, target in self.folders.targets.items():
            found = {key: warp.warp for key, warp in placements.items() if key[1] == name and not isinstance(warp, str)}
            masks = [shown(warp, self.folders.captures[key].shape[1:]) for key, warp in found.items()]
            if not masks or all(mask.all() for mask in masks):
                continue
            part = largest_part(np.logical_and.reduce(masks))
            common = share(part, target.shape[1:])
            if common >= LEAST:
                parts[name] = part
                continue
            seen = ", ".join(f"{key[0]} {mask.mean():.0%}" for key, mask in zip(found, masks, strict=True))
            needed = f"{LEAST:.0%} is needed; score those that show least apart"
            reason = f"the captures of this target have {common:.0%} of it in common ({seen}), and {needed}"
            placements |= dict.fromkeys(found, reason)
        return parts

    def scored(self, key: Key, alignment: Alignment | str | None, kind: str, part: Part | None) -> Record:
        """The record of a capture: kept, or computed."""
        method, name = key
        geometry = {"kind": kind, **alignment.to_dict()} if isinstance(alignment, Alignment) else {"kind": "none"}
        cell = self.cell(method, name, geometry, part=part)
        if alignment is None:
            reason = f"no capture of '{name}' in the folder of {method}"
            return Record(cell, "missing", method, CONDITION, name, reason)
        if isinstance(alignment, str):
            return self.failed(cell, alignment)
        figure = self.store.output / "figures" / alignment_name(*key)
        kept = self.store.read(digest(cell))
        drawn = kept is not None and figure.is_file() and self.store.thumbnail(kept.id).is_file()
        is_full = kept is not None and not identity.lacking(kept.scores, self.metrics)
        if kept is not None and drawn and is_full and "odd_pixels" in kept.values():
            return kept  # and not of a version that did not look for the camera's faults
        capture, target = self.loaded(key)
        warp = alignment.warp if part is None else cropped(alignment.warp, part)
        target = part_of(target, part)
        picture = self.folders.captures[key]
        raw = self.compared(key, picture.load())
        if too_few := too_few_levels(picture, self.folders.targets[name], raw, target, warp):
            return self.failed(cell, too_few)
        saturated = float(clipped(raw, target, warp, picture.full).mean())
        if self.values == "linear" and saturated > MOST_SATURATED:
            much = f"{saturated:.2%} of the scored samples are clipped, more than {MOST_SATURATED:.1%}"
            if clipped(mended(raw, warp)[0], target, warp, picture.full).mean() > MOST_SATURATED:
                return self.failed(cell, f"the capture is over-exposed: {much}")
            hot = f"{much}, and stand alone, as hot pixels do"
            return self.failed(cell, f"{hot}; have the camera's software replace them, or expose for a shorter time")
        del raw
        frame = self.target_values(capture) if self.values == "srgb" else capture
        compared = torch.from_numpy(self.target_values(target))
        figures = self.second(frame, compared, warp)
        # In the precision that scores are computed in, so that there is no second copy of a large picture.
        image, reference = torch.from_numpy(sampled(frame, warp)).double(), compared.double()
        if swapped := exchange(image, reference):
            return self.failed(cell, swapped)
        figures["darkest"] = darkest(self.as_light(image), self.as_light(reference))
        scores = self.scores(image, reference, self.metrics)
        figures |= self.without_faults(frame, compared, warp)
        del capture, frame, compared  # of a large picture, read again to be drawn
        capture, _ = self.loaded(key)
        if self.visible:
            figures["share_seen"] = float(shown(alignment.warp, capture.shape[1:]).mean())
            figures["share_scored"] = 1.0 if part is None else share(part, alignment.warp.shape)
        record = Record(cell, "done", method, CONDITION, name, scores=scores, figures=figures, saturated=saturated)
        matched, _ = match(image.float(), reference.float())
        write_thumbnail(self.store.thumbnail(record.id), self.as_light(matched))
        encoded = matched if self.values == "stored" else srgb_encode(matched)
        self.draw(figure, self.viewable(capture), warp, encoded.numpy(), target)
        self.store.write(record)
        return record

    def failed(self, cell: dict[str, Any], reason: str) -> Record:
        """The record of a capture that has no score."""
        record = Record(cell, "failed", cell["method"], CONDITION, cell["target"], reason)
        self.store.write(record)
        return record

    def second(self, frame: Values, compared: Tensor, first: Warp) -> dict[str, float]:
        """PSNR and SSIM by a second algorithm's geometry, and the distance between the two; empty where it finds none.

        frame, compared: a capture and its target in the values that are compared.
        """
        small, to_target = reduced(gray(self.as_light(compared).numpy()), WIDE)
        side = round(max(frame.shape) * max(small.shape) / max(first.shape))
        shrunk, to_frame = reduced(gray(self.as_light(torch.from_numpy(frame)).numpy()), side)
        homography = np.linalg.inv(to_frame) @ first.homography @ to_target
        found = second_warp(shrunk, small, Warp((small.shape[0], small.shape[1]), homography, np.zeros((6, 2))))
        if found is None:
            return {}
        other = replace(first, homography=to_frame @ found.homography @ np.linalg.inv(to_target))
        image, stored = torch.from_numpy(sampled(frame, other)), self.values == "stored"
        scores = score(image, compared, refine=False, blur=(), metrics=("psnr", "ssim"), stored=stored)
        seconds = {f"{name}_{self.domain}_second": scores[f"{name}_{self.domain}"] for name in ("psnr", "ssim")}
        return seconds | {"second_aligner_px": disagreement(first, other)}

    def without_faults(self, frame: Values, compared: Tensor, warp: Warp) -> dict[str, float]:
        """How many samples of a capture only its camera can have made, and the PSNR without them; arguments as above.

        It is told beside the score, which stays.
        """
        better, odd = mended(self.as_light(torch.from_numpy(frame)).numpy(), warp)
        if not odd:
            return {"odd_pixels": 0.0}
        stored = self.values == "stored"
        image = sampled(srgb_encode(torch.from_numpy(better)).numpy() if stored else better, warp)
        scores = score(torch.from_numpy(image), compared, refine=False, blur=(), metrics=("psnr",), stored=stored)
        return {"odd_pixels": float(odd), f"psnr_{self.domain}_mended": scores[f"psnr_{self.domain}"]}

    def floor(self, name: str, part: Part | None) -> list[Record]:
        """The records of floor images."""
        targets, channels = self.folders.targets, self.floor_channels(name)
        names = list(targets)
        after = names[names.index(name) + 1 :] + names[: names.index(name)]
        fitting = [other for other in after if targets[other].shape[1:] == targets[name].shape[1:]]
        wrong = [other for other in fitting if self.floor_channels(other) == channels][:1]
        other = {"floor_wrong_target": wrong[0]} if wrong else {}
        rows = [row for row in FLOORS if wrong or row != "floor_wrong_target"]
        cells = {row: self.cell(row, name, {"kind": "reference"}, other.get(row, ""), part) for row in rows}
        kept = [record for cell in cells.values() if (record := self.store.read(digest(cell))) is not None]
        thumbnail = self.store.target_thumbnail(name)
        shape = targets[name].shape[1:] if part is None else (part[1] - part[0], part[3] - part[2])
        is_large = math.prod(shape) > LARGE
        metrics = {k: v for k, v in self.metrics.items() if not (is_large and k.startswith(SLOW))}
        lacking = [record for record in kept if identity.lacking(record.scores, metrics)]
        if len(kept) == len(cells) and not lacking and thumbnail.is_file():
            return kept
        pair = (part_of(targets[target].load()[:channels], part) for target in (name, *wrong))
        reference, *others = (torch.from_numpy(self.target_values(target)) for target in pair)
        write_thumbnail(thumbnail, self.as_light(reference))
        pictures, wide, records = floor_captures(reference, others, name), reference.double(), []
        for row, cell in cells.items():
            scores = self.scores(pictures[row]().double(), wide, metrics)
            records.append(Record(cell, "done", row, REFERENCE, name, scores=scores))
            self.store.write(records[-1])
        return records

    def scores(self, image: Tensor, reference: Tensor, metrics: Mapping[str, str]) -> dict[str, Scores]:
        """The scores by some metrics, in the domains that the values have."""
        weights, stored, names = self.lpips_weights, self.values == "stored", identity.named(metrics)
        columns = score(image, reference, lpips_weights=weights, stored=stored, metrics=names)
        return identity.grouped(columns, metrics)

    def target_values(self, target: Values) -> Values:
        """A target in the values that are compared."""
        return target if self.values == "stored" else srgb_decode(torch.from_numpy(target)).numpy()

    def as_light(self, compared: Tensor) -> Tensor:
        """Linear light of values that are compared, for thumbnails, which are sRGB, and for the second aligner."""
        return srgb_decode(compared) if self.values == "stored" else compared

    def cell(
        self, method: str, name: str, geometry: dict[str, Any], wrong: str = "", part: Part | None = None
    ) -> dict[str, Any]:
        """The plain description of a number."""
        capture = self.folders.captures.get((method, name))
        channel = self.folders.pairings[method, name].channel if capture else ""
        is_reference = geometry["kind"] == "reference"
        if is_reference and self.floor_channels(name) < self.folders.targets[name].shape[0]:
            channel = "gray"
        return {
            "method": method,
            "params": {"target": wrong, "target_sha256": self.folders.targets[wrong].sha256} if wrong else {},
            "dataset": FILES,
            "dataset_params": {},
            "target": name,
            "target_sha256": self.folders.targets[name].sha256,
            "capture_sha256": capture.sha256 if capture else "",
            "condition": REFERENCE if is_reference else CONDITION,
            "panel": list(capture.shape[1:]) if capture else [],
            "repeat": 0,
            "values": self.values,
            "geometry": geometry,
            **({"channel": channel} if channel else {}),
            **({"part": list(part)} if part else {}),
            **({"visible": True} if self.visible and not is_reference else {}),
            **({"dark": self.dark} if self.dark and not is_reference else {}),
            "protocol": VERSION,
            "harness": HARNESS,
            "alignment": ALIGNMENT,
        }


def _read(path: Path) -> Alignment | str | None:
    """A kept alignment, or why there is none; None where neither is kept or can be read."""
    try:
        plain = json.loads(path.read_text(encoding="utf-8"))
        return str(plain["refused"]) if "refused" in plain else Alignment.from_dict(plain)
    except (OSError, ValueError, TypeError, LookupError):
        return None
