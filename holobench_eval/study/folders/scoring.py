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

from ...core.allocator import return_large_arrays
from ...core.errors import CellError
from ...core.hashing import digest
from ...core.io import write_atomically
from ...imaging.align import Alignment, align, confirmed, gray
from ...imaging.cross_check import disagreement, second_warp
from ...imaging.shared_pose import sampled, shared
from ...imaging.similarity import reduced, similarity
from ...imaging.warp import Warp
from ...metrics import catalogue, floor_captures, match, score
from ...metrics.protocol import VERSION
from ...optics.colour import srgb_decode, srgb_encode
from .. import identity, provenance
from ..plan import FLOORS, REFERENCE
from ..scoring.pictures import write_thumbnail
from ..store import Record, Scores, Store
from ..versions import ALIGNMENT, HARNESS
from . import FILES, alignment_name
from .exposure import burnt
from .files import Folders, Key
from .pairing import too_few_levels
from .pictures import Values
from .visible import LEAST, Part, cropped, largest_part, part_of, share, shown

LARGE = 2**21  # pixels of a target, those of 1080 x 1920
WIDE = 2048  # pixels of a target's longer side to which the second aligner, of which 0.1 px is asked, reduces it
SLOW = ("flip", "mofd", "lpips", "haarpsi")  # how their names begin: the floor of a `LARGE` target has none of them
CONDITION = "photographed display"

Alignments = dict[Key, Alignment | str]  # or the reason of a refusal
Step = Callable[[str], None]  # called with the name of each step
Draw = Callable[[Path, Values, Warp, Values, Values], None]  # file, capture, warp, matched capture, target


def described(folders: Folders, values: str) -> dict[str, Any]:
    """Everything about the present scoring of pictures for their ``provenance.json``."""
    files = {f"captures/{'/'.join(key)}": picture.sha256 for key, picture in folders.captures.items()}
    files |= {f"targets/{name}": picture.sha256 for name, picture in folders.targets.items()}
    code = {"metrics": HARNESS, "alignment": ALIGNMENT}
    return {"code_sha256": code, "files": files, "values": values, **provenance.software()}


@dataclass(frozen=True)
class Scoring:
    """Captures from folders, and how they are scored.

    store: of records, alignments and pictures; values: how files are read, ``stored`` (as they are), ``srgb``, or
    ``linear`` (captures as linear light); draw: draws an alignment from display-encoded values; visible: score the part
    of a target that all its captures show, if that is half of it; aligned: captures lie on their targets already.
    """

    folders: Folders
    store: Store
    values: str
    lpips_weights: str | None
    draw: Draw
    visible: bool = False
    aligned: bool = False

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
        kept = set()
        for method in self.folders.methods:
            for name in self.folders.targets:
                key = (method, name)
                if key in self.folders.captures:
                    step(f"scoring {method}, {name}")
                shared = key in placements and placements[key] != own[key]
                kind = "given" if self.aligned else "shared" if shared else "own"
                records.append(self.scored(key, placements.get(key), kind, parts.get(name)))
                kept.add(alignment_name(*key))
        for old in (self.store.output / "figures").glob("alignment-*.jpg"):
            if old.name not in kept:
                old.unlink()
        return records

    def alignments(self, step: Step) -> Alignments:
        """Every capture's own alignment, kept from an earlier run or computed."""
        own: Alignments = {}
        for key, picture in self.folders.captures.items():
            step(f"aligning {key[0]}, {key[1]}")
            pairing, target = self.folders.pairings[key], self.folders.targets[key[1]]
            if pairing.refused or self.aligned:
                own[key] = pairing.refused or self.given(key)
                continue
            chosen = [*filter(None, [pairing.channel, "visible" if self.visible else ""])]
            key_digest = digest([picture.sha256, target.sha256, self.values == "linear", ALIGNMENT, *chosen])
            path = self.store.folder / f"alignment-{key_digest}.json"
            plain = _read(path)
            if plain is None:
                plain = self.found(key)
                write_atomically(path, f"{json.dumps(plain, sort_keys=True, allow_nan=False)}\n".encode())
            own[key] = str(plain["refused"]) if "refused" in plain else Alignment.from_dict(plain)
        return own

    def given(self, key: Key) -> Alignment | str:
        """Pixel to pixel, how alike a capture is to its target; or why it is refused."""
        picture, target = self.folders.captures[key].shape[1:], self.folders.targets[key[1]].shape[1:]
        if picture != target:
            return (
                f"the capture has {picture[1]} x {picture[0]} pixels and the target {target[1]} x {target[0]}; aligned "
                "captures have the size of their target"
            )
        warp = Warp(target, np.eye(3), np.zeros((6, 2)))
        frame, reference = (gray(values) for values in self.loaded(key))
        return Alignment(warp, similarity(frame, reference, warp).overall)

    def found(self, key: Key) -> dict[str, Any]:
        """The alignment of a capture by itself, or why it is refused, as plain values."""
        capture, target = self.loaded(key)
        try:
            return align(self.viewable(capture), target, self.visible).to_dict()
        except CellError as error:
            return {"refused": f"{error}{burnt(capture)}"}

    def loaded(self, key: Key) -> tuple[Values, Values]:
        """A capture and its target, in the channels that are compared."""
        capture, target = self.folders.captures[key].load(), self.folders.targets[key[1]].load()
        index = self.folders.pairings[key].index
        return (capture, target) if index is None else (capture[index : index + 1], target[:1])

    def floor_channels(self, name: str) -> int:
        """How many channels of a target its floor has: one where a capture of it is scored on one."""
        single = any(pairing.channel for (_, target), pairing in self.folders.pairings.items() if target == name)
        return 1 if single else self.folders.targets[name].shape[0]

    def viewable(self, values: Values) -> Values:
        """Display-encoded values of a capture, in which it can be compared with its target by eye and by features."""
        if self.values != "linear":
            return values
        bright = max(float(np.percentile(values, 99.5)), 1e-6)
        return srgb_encode(torch.from_numpy(values) / bright).numpy()

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
            if share(part, target.shape[1:]) >= LEAST:
                parts[name] = part
                continue
            seen = ", ".join(f"{key[0]} {mask.mean():.0%}" for key, mask in zip(found, masks, strict=True))
            placements |= dict.fromkeys(
                found,
                f"the captures of this target have {share(part, target.shape[1:]):.0%} of it in common ({seen}), and "
                f"{LEAST:.0%} is needed; score those that show least apart",
            )
        return parts

    def scored(self, key: Key, alignment: Alignment | str | None, kind: str, part: Part | None) -> Record:
        """The record of a capture: kept, or computed."""
        method, name = key
        cell = self.cell(method, name, alignment, kind, part=part)
        if alignment is None:
            reason = f"no capture of '{name}' in the folder of {method}"
            return Record(cell, "missing", method, CONDITION, name, reason)
        if isinstance(alignment, str):
            return self.failed(cell, alignment)
        figure = self.store.output / "figures" / alignment_name(*key)
        kept = self.store.read(digest(cell))
        drawn = kept is not None and figure.is_file() and self.store.thumbnail(kept.id).is_file()
        if kept is not None and drawn and not identity.lacking(kept.scores, self.metrics):
            return kept
        capture, target = self.loaded(key)
        warp = alignment.warp if part is None else cropped(alignment.warp, part)
        target = part_of(target, part)
        if too_few := too_few_levels(self.folders.captures[key], self.folders.targets[name], capture, target, warp):
            return self.failed(cell, too_few)
        second = self.second(capture, target, warp)
        # In the precision that scores are computed in, so that there is no second copy of a large picture.
        image = torch.from_numpy(sampled(self.capture_values(capture), warp)).double()
        reference = torch.from_numpy(self.target_values(target)).double()
        full = sampled((capture >= 1).astype(np.float32), warp)
        saturated = float((full > 0.5).mean())
        del capture, full  # of a large picture, read again to be drawn
        scores, figures = self.scores(image, reference, self.metrics), second
        capture, _ = self.loaded(key)
        if self.visible:
            figures["share_seen"] = float(shown(alignment.warp, capture.shape[1:]).mean())
            figures["share_scored"] = 1.0 if part is None else share(part, alignment.warp.shape)
        record = Record(cell, "done", method, CONDITION, name, scores=scores, figures=figures, saturated=saturated)
        matched, _ = match(image.float(), reference.float())
        write_thumbnail(self.store.thumbnail(record.id), self.as_light(matched))
        self.draw(figure, self.viewable(capture), warp, self.encoded(matched), target)
        self.store.write(record)
        return record

    def failed(self, cell: dict[str, Any], reason: str) -> Record:
        """The record of a capture that has no score."""
        record = Record(cell, "failed", cell["method"], CONDITION, cell["target"], reason)
        self.store.write(record)
        return record

    def second(self, capture: Values, target: Values, first: Warp) -> dict[str, float]:
        """PSNR and SSIM by a second algorithm's geometry, and the distance between the two geometries."""
        frame, compared = self.capture_values(capture), torch.from_numpy(self.target_values(target))
        other = self.second_geometry(torch.from_numpy(frame), compared, first)
        if other is None:
            return {}
        image = torch.from_numpy(sampled(frame, other))
        other_scores = score(
            image, compared, refine=False, blur=(), metrics=("psnr", "ssim"), stored=self.values == "stored"
        )
        scores = {f"{name}_{self.domain}_second": other_scores[f"{name}_{self.domain}"] for name in ("psnr", "ssim")}
        return scores | {"second_aligner_px": disagreement(first, other)}

    def second_geometry(self, frame: Tensor, compared: Tensor, first: Warp) -> Warp | None:
        """Where a second algorithm finds the target, from values of a capture and its target that are compared."""
        small, to_target = reduced(gray(self.as_light(compared).numpy()), WIDE)
        side = round(max(frame.shape) * max(small.shape) / max(first.shape))
        shrunk, to_frame = reduced(gray(self.as_light(frame).numpy()), side)
        homography = np.linalg.inv(to_frame) @ first.homography @ to_target
        found = second_warp(shrunk, small, Warp((small.shape[0], small.shape[1]), homography, np.zeros((6, 2))))
        if found is None:
            return None
        return replace(first, homography=to_frame @ found.homography @ np.linalg.inv(to_target))

    def floor(self, name: str, part: Part | None) -> list[Record]:
        """The records of floor images."""
        names = list(self.folders.targets)
        after = names[names.index(name) + 1 :] + names[: names.index(name)]
        targets, channels = self.folders.targets, self.floor_channels(name)
        fitting = [other for other in after if targets[other].shape[1:] == targets[name].shape[1:]]
        wrong = [other for other in fitting if self.floor_channels(other) == channels][:1]
        rows = [row for row in FLOORS if wrong or row != "floor_wrong_target"]
        given = {row: wrong[0] if "wrong" in row else "" for row in rows}
        cells = {row: self.cell(row, name, None, "reference", given[row], part) for row in rows}
        kept = [record for cell in cells.values() if (record := self.store.read(digest(cell))) is not None]
        thumbnail = self.store.target_thumbnail(name)
        large = (
            math.prod(self.folders.targets[name].shape[1:] if part is None else (part[1] - part[0], part[3] - part[2]))
            > LARGE
        )
        metrics = {k: v for k, v in self.metrics.items() if not (large and k.startswith(SLOW))}
        lacking = [record for record in kept if identity.lacking(record.scores, metrics)]
        if len(kept) == len(rows) and not lacking and thumbnail.is_file():
            return kept
        pair = (part_of(targets[target].load()[:channels], part) for target in (name, *wrong))
        reference, *others = (torch.from_numpy(self.target_values(target)) for target in pair)
        write_thumbnail(thumbnail, self.as_light(reference))
        pictures, wide = floor_captures(reference, others, name), reference.double()
        records = [
            Record(
                cells[row], "done", row, REFERENCE, name, scores=self.scores(pictures[row]().double(), wide, metrics)
            )
            for row in rows
        ]
        for record in records:
            self.store.write(record)
        return records

    def scores(self, image: Tensor, reference: Tensor, metrics: Mapping[str, str]) -> dict[str, Scores]:
        """The scores by some metrics, in the domains that the values have."""
        weights, stored, names = self.lpips_weights, self.values == "stored", identity.named(metrics)
        columns = score(image, reference, lpips_weights=weights, stored=stored, metrics=names)
        if len(image) == 1:
            columns = {"match_factor" if name == "scale_0" else name: value for name, value in columns.items()}
        return identity.grouped(columns, metrics)

    def target_values(self, target: Values) -> Values:
        """A target in the values that are compared."""
        return target if self.values == "stored" else srgb_decode(torch.from_numpy(target)).numpy()

    def capture_values(self, capture: Values) -> Values:
        """A capture in the values that are compared."""
        return self.target_values(capture) if self.values == "srgb" else capture

    def as_light(self, compared: Tensor) -> Tensor:
        """Linear light of values that are compared, for thumbnails, which are sRGB, and for the second aligner."""
        return srgb_decode(compared) if self.values == "stored" else compared

    def encoded(self, compared: Tensor) -> Values:
        """Display-encoded values of values that are compared."""
        values = compared if self.values == "stored" else srgb_encode(compared)
        return values.float().numpy()

    def cell(
        self,
        method: str,
        name: str,
        alignment: Alignment | str | None,
        kind: str,
        wrong: str = "",
        part: Part | None = None,
    ) -> dict[str, Any]:
        """The plain description of a number."""
        capture = self.folders.captures.get((method, name))
        channel = self.folders.pairings[method, name].channel if capture else ""
        if kind == "reference" and self.floor_channels(name) < self.folders.targets[name].shape[0]:
            channel = "gray"
        geometry: dict[str, Any] = {"kind": kind}
        if kind != "reference":
            geometry = {"kind": kind, **alignment.to_dict()} if isinstance(alignment, Alignment) else {"kind": "none"}
        return {
            "method": method,
            "params": {"target": wrong, "target_sha256": self.folders.targets[wrong].sha256} if wrong else {},
            "dataset": FILES,
            "dataset_params": {},
            "target": name,
            "target_sha256": self.folders.targets[name].sha256,
            "capture_sha256": capture.sha256 if capture else "",
            "condition": REFERENCE if kind == "reference" else CONDITION,
            "panel": list(capture.shape[1:]) if capture else [],
            "repeat": 0,
            "values": self.values,
            "geometry": geometry,
            **({"channel": channel} if channel else {}),
            **({"part": list(part)} if part else {}),
            **({"visible": True} if self.visible and kind != "reference" else {}),
            "protocol": VERSION,
            "harness": HARNESS,
            "alignment": ALIGNMENT,
        }


def _read(path: Path) -> dict[str, Any] | None:
    """A kept alignment; None where it is missing or unreadable."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    keys = set(content) if isinstance(content, Mapping) else set()
    return content if keys in ({"refused"}, {"shape", "homography", "correlation"}) else None
