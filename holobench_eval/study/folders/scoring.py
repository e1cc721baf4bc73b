"""Alignments, scores and pictures of given captures: what ``holoeval score`` computes and keeps."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from ...core.errors import CellError
from ...core.hashing import digest
from ...core.io import write_atomically
from ...imaging.align import Alignment, align, confirmed, gray
from ...imaging.cross_check import disagreement, second_warp
from ...imaging.shared_pose import sampled, shared
from ...imaging.warp import Warp
from ...metrics import catalogue, floor_captures, match, score
from ...metrics.protocol import VERSION
from ...optics.colour import srgb_decode, srgb_encode
from ...report.charts.alignment import alignment_name, draw_alignment
from ...report.data.text import FILES
from ..plan import FLOORS, REFERENCE
from ..scoring.pictures import write_thumbnail
from ..store import Record, Store
from ..versions import ALIGNMENT, HARNESS
from .files import Folders, Picture, Values

CONDITION = "photographed display"

Key = tuple[str, str]
"""Method and name of the target."""
Found = dict[Key, Alignment | str]
"""Alignments, or the reasons why there are none."""
Said = Callable[[str], None]
"""Told the name of each step."""


@dataclass(frozen=True)
class Scoring:
    """The pictures, where what is known of them is kept, and how they are read."""

    folders: Folders
    store: Store
    values: str
    lpips_weights: str | None

    @property
    def domain(self) -> str:
        """In which PSNR and SSIM are given."""
        return "stored" if self.values == "stored" else "linear"

    @cached_property
    def metrics(self) -> list[str]:
        """Name and version of every metric that can be computed here."""
        weights = None if self.lpips_weights is None else Path(self.lpips_weights)
        return [f"{one.name} {one.version}" for one in catalogue(weights) if one.available() is None]

    def records(self, step: Said) -> list[Record]:
        """A record for every method and target, and for the floor; old pictures of alignments go."""
        found = self.alignments(step)
        placed = {**found, **self.common(found)}
        records = []
        for name in self.folders.targets:
            step(f"floor of {name}")
            records += self.floor(name)
        kept = set()
        for method in self.folders.methods:
            for name in self.folders.targets:
                key = (method, name)
                if key in self.folders.captures:
                    step(f"scoring {method}, {name}")
                records.append(self.scored(key, placed.get(key), shared=key in placed and placed[key] != found[key]))
                kept.add(alignment_name(*key))
        for old in (self.store.output / "figures").glob("alignment-*.jpg"):
            if old.name not in kept:
                old.unlink()
        return records

    def alignments(self, step: Said) -> Found:
        """Every capture's own alignment, from what is kept of an earlier run or computed."""
        found: Found = {}
        for key, picture in self.folders.captures.items():
            step(f"aligning {key[0]}, {key[1]}")
            target = self.folders.targets[key[1]]
            identity = digest([picture.sha256, target.sha256, self.values == "linear", ALIGNMENT])
            path = self.store.folder / f"alignment-{identity}.json"
            known = _read(path)
            if known is None:
                known = self.own(picture, target)
                write_atomically(path, f"{json.dumps(known, sort_keys=True, allow_nan=False)}\n".encode())
            found[key] = str(known["refused"]) if "refused" in known else Alignment.from_dict(known)
        return found

    def own(self, picture: Picture, target: Picture) -> dict[str, Any]:
        """The alignment of a capture by itself, or why it is refused, as plain values."""
        if picture.shape[0] != target.shape[0]:
            kinds = {1: "gray", 3: "in colour"}
            return {
                "refused": f"the capture is {kinds[picture.shape[0]]} and the target {kinds[target.shape[0]]}; "
                "both have to be of one kind"
            }
        try:
            return align(self.shown(picture.load()), target.load()).to_dict()
        except CellError as error:
            return {"refused": str(error)}

    def shown(self, values: Values) -> Values:
        """Display-encoded values of a capture, in which it can be compared with its target by eye and by features."""
        if self.values != "linear":
            return values
        bright = max(float(np.percentile(values, 99.5)), 1e-6)
        return srgb_encode(torch.from_numpy(values) / bright).numpy()

    def common(self, found: Found) -> Found:
        """The shared alignments: by frame size and shape of the target, for those that agree or that they fit."""
        captures, targets = self.folders.captures, self.folders.targets
        groups: dict[tuple[int, ...], list[Key]] = {}
        for key, picture in captures.items():
            groups.setdefault((*picture.shape, *targets[key[1]].shape), []).append(key)
        placed: Found = {}
        for keys in groups.values():
            one = shared({key: own for key in keys if isinstance(own := found[key], Alignment)})
            for key in keys if one is not None else ():
                assert one is not None
                if key in one[1] or isinstance(found[key], str):
                    fits = confirmed(self.shown(captures[key].load()), targets[key[1]].load(), one[0])
                    placed |= {key: fits} if fits is not None else {}
        return placed

    def scored(self, key: Key, place: Alignment | str | None, shared: bool) -> Record:
        """The record of a capture: kept, or computed."""
        method, name = key
        described = self.cell(method, name, place, "shared" if shared else "own")
        if place is None:
            return Record(described, "missing", method, f"no capture of '{name}' in the folder of {method}")
        if isinstance(place, str):
            record = Record(described, "failed", method, f"CellError: {place}")
            self.store.write(record)
            return record
        figure = self.store.output / "figures" / alignment_name(*key)
        known = self.store.read(digest(described))
        if known is not None and figure.is_file() and self.store.thumbnail(known.id).is_file():
            return known
        capture, target = self.folders.captures[key].load(), self.folders.targets[name].load()
        image, wanted = (
            torch.from_numpy(sampled(self.taken(capture), place.warp)),
            torch.from_numpy(self.decoded(target)),
        )
        scores = self.scores(image, wanted) | self.second(capture, target, place.warp)
        full = sampled((capture >= 1).astype(np.float32), place.warp)
        record = Record(described, "done", method, scores=scores, saturated=float((full > 0.5).mean()))
        matched, _ = match(image, wanted)
        write_thumbnail(self.store.thumbnail(record.id), self.as_light(matched))
        draw_alignment(figure, self.shown(capture), place.warp, self.encoded(matched), target)
        self.store.write(record)
        return record

    def second(self, capture: Values, target: Values, first: Warp) -> dict[str, float]:
        """PSNR and SSIM by the geometry that another algorithm finds, and how far apart the two are."""
        frame, reference = (
            self.as_light(torch.from_numpy(self.taken(capture))),
            self.as_light(torch.from_numpy(self.decoded(target))),
        )
        other = second_warp(gray(frame.numpy()), gray(reference.numpy()), first)
        if other is None:
            return {}
        image = torch.from_numpy(sampled(self.taken(capture), other))
        again = score(
            image,
            torch.from_numpy(self.decoded(target)),
            refine=False,
            blur=(),
            metrics=("psnr", "ssim"),
            stored=self.values == "stored",
        )
        scores = {f"{name}_{self.domain}_second": again[f"{name}_{self.domain}"] for name in ("psnr", "ssim")}
        return scores | {"second_aligner_px": disagreement(first, other)}

    def floor(self, name: str) -> list[Record]:
        """The records of what no method made."""
        names = list(self.folders.targets)
        after = names[names.index(name) + 1 :] + names[: names.index(name)]
        shape = self.folders.targets[name].shape
        wrong = [other for other in after if self.folders.targets[other].shape == shape][:1]
        rows = [row for row in FLOORS if wrong or row != "floor_wrong_target"]
        cells = {row: self.cell(row, name, None, "reference", wrong[0] if "wrong" in row else "") for row in rows}
        known = {row: self.store.read(digest(cell)) for row, cell in cells.items()}
        kept = [record for record in known.values() if record is not None]
        thumbnail = self.store.target_thumbnail(name)
        if len(kept) == len(rows) and thumbnail.is_file():
            return kept
        wanted, *others = (torch.from_numpy(self.decoded(self.folders.targets[one].load())) for one in (name, *wrong))
        write_thumbnail(thumbnail, self.as_light(wanted))
        pictures = floor_captures(wanted, others, name)
        records = [Record(cells[row], "done", row, scores=self.scores(pictures[row], wanted)) for row in rows]
        for record in records:
            self.store.write(record)
        return records

    def scores(self, image: Tensor, wanted: Tensor) -> dict[str, float]:
        """All of the protocol, in the domains that the values have."""
        found = score(image, wanted, lpips_weights=self.lpips_weights, stored=self.values == "stored")
        return found if len(image) > 1 else {"match_factor" if k == "scale_0" else k: v for k, v in found.items()}

    def decoded(self, target: Values) -> Values:
        """A target in the values that are compared."""
        return target if self.values == "stored" else srgb_decode(torch.from_numpy(target)).numpy()

    def taken(self, capture: Values) -> Values:
        """A capture in the values that are compared."""
        return self.decoded(capture) if self.values == "srgb" else capture

    def as_light(self, compared: Tensor) -> Tensor:
        """Linear light of values that are compared, for thumbnails, which are sRGB, and for the second aligner."""
        return srgb_decode(compared) if self.values == "stored" else compared

    def encoded(self, compared: Tensor) -> Values:
        """Display-encoded values of values that are compared."""
        shown = compared if self.values == "stored" else srgb_encode(compared)
        return shown.float().numpy()

    def cell(self, method: str, name: str, place: Alignment | str | None, kind: str, wrong: str = "") -> dict[str, Any]:
        """The plain description of a number."""
        capture = self.folders.captures.get((method, name))
        geometry: dict[str, Any] = {"kind": kind}
        if kind != "reference":
            geometry = {"kind": kind, **place.to_dict()} if isinstance(place, Alignment) else {"kind": "none"}
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
            "protocol": VERSION,
            "metrics": self.metrics,
            "harness_sha256": HARNESS,
            "code_sha256": ALIGNMENT,
        }


def _read(path: Path) -> dict[str, Any] | None:
    """A kept alignment; None where there is none, or none that can be read."""
    try:
        known = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    keys = set(known) if isinstance(known, Mapping) else set()
    return known if keys in ({"refused"}, {"shape", "homography", "correlation"}) else None
