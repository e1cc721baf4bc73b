"""The thumbnails of a study: pictures of targets and captures, and which of them are not there."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from ...study.store import Store
from ..data.results import Results
from ..data.scores import Score
from ..data.tables import DONE
from .gallery import Picture, Tile, load_picture

COPIES = "pictures"  # folder of the small copies that a report keeps


class Thumbnails:
    """Pictures of a report's targets and captures, as far as they are there."""

    def __init__(self, results: Results, output: Path) -> None:
        """output: the folder of the report."""
        self.results, self.store, self.copies = results, Store(output), output / COPIES
        self._targets: dict[str, dict[str, Picture]] = {}

    def of_capture(self, cell: str) -> Path:
        """The file of a cell's capture: that of its record, or the small copy where the records are not there."""
        return self._there(self.store.thumbnail(cell))

    def of_target(self, target: str, shape: Sequence[int]) -> Path:
        """The same of a target as displays show it, ``(C, h, w)``."""
        return self._there(self.store.target_thumbnail(target, shape))

    def _there(self, thumbnail: Path) -> Path:
        return thumbnail if thumbnail.is_file() else self.copies / f"{thumbnail.stem}.webp"

    def targets(self, condition: str) -> dict[str, Picture]:
        """The targets that have a picture, as a display is to show them, in their order."""
        reference = self.results.reference(condition)
        shape = self.results.shape(reference)
        if reference not in self._targets:
            paths = {target: self.of_target(target, shape) for target in self.results.targets}
            pictures = ((target, load_picture(path)) for target, path in paths.items())
            self._targets[reference] = {target: picture for target, picture in pictures if picture is not None}
        return self._targets[reference]

    def tile(self, label: str, condition: str, target: str) -> Tile:
        """The capture of the first repeat that is done, with its own scores; without one, the reason in its place."""
        cells = self.results.cells(label, condition)
        cells = cells[cells["target"] == target]
        if cells.empty:
            return Tile(None, "not planned")
        done = cells[cells["state"] == DONE]
        if done.empty:
            return Tile(None, f"{cells.iloc[0]['state']}: {cells.iloc[0]['reason']}")
        cell, shape = done.iloc[0], self.targets(condition)[target].shape
        picture = load_picture(self.of_capture(str(cell["cell"])))
        if picture is None:
            return Tile(None, "no thumbnail of this capture")
        if picture.shape != shape:
            return Tile(None, f"thumbnail is {picture.shape[1]} x {picture.shape[0]}, target {shape[1]} x {shape[0]}")
        scores = [self.results.headline, *(score for score in self.results.leading if score.metric == "ssim")][:2]
        return Tile(picture, noted(scores, cell))

    def by_quality(self, condition: str) -> list[str]:
        """The targets that have a picture, from worst to best by their mean over methods."""
        results = self.results
        values = np.vstack([results.values(label, condition) for label in results.methods(condition)])
        known = np.isfinite(values)
        means = np.where(known, values, 0).sum(axis=0) / np.maximum(known.sum(axis=0), 1)
        quality = dict(zip(results.targets, results.headline.sign * means, strict=True))
        return sorted(self.targets(condition), key=lambda target: quality[target])

    def middle(self, condition: str) -> str:
        """The target in the middle of ``by_quality``."""
        ordered = self.by_quality(condition)
        return ordered[len(ordered) // 2]


def noted(scores: Sequence[Score], cell: pd.Series) -> str:
    """The scores of a cell for below its tile, which is narrow: that all are in focus stands there once."""
    focus = all(score.in_focus for score in scores)
    values = (
        f"{score.name if focus else score.title} {score.with_unit(float(cell[score.column]))}" for score in scores
    )
    return ("in focus: " if focus else "") + "   ".join(values)
