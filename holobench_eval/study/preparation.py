"""What a method has to learn before it can solve, in plain words: the name of its artifact follows from it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..core import plugins
from ..core.errors import UserError
from ..core.hashing import digest
from .displays import Condition

if TYPE_CHECKING:
    from .config import Study


@dataclass(frozen=True)
class Preparation:
    """A method, the display it is trained on, and the images it is trained with.

    method, params: as in a cell; version: the method's own ``version``, raised when its training changes; folder: the
    config's folder; place: the display; dataset, dataset_params: source of the images; images: name and digest of
    each; held_out: how many of the last only watch the training; captures: the most it may take; seed: the study's.
    """

    method: str
    version: int
    params: Mapping[str, Any]
    folder: Path
    place: Condition
    dataset: str
    dataset_params: Mapping[str, Any]
    images: tuple[tuple[str, str], ...]
    held_out: int
    captures: int | None
    seed: int

    def description(self) -> dict[str, Any]:
        """Everything that the learned state depends on, as plain JSON values. The harness's code is not part of it:
        a faster bench need not cost a day of training; ``provenance.json`` says with which code it was made."""
        spec = self.place.spec
        return {
            "method": self.method,
            "version": self.version,
            "params": dict(self.params),
            "profile": self.place.name,
            "profile_version": self.place.version,
            "panel": list(spec.shape),
            "wavelengths": list(spec.wavelengths),
            "pitch": spec.pitch,
            "distance": spec.distance,
            "profile_sha256": self.place.digest,
            "training": self.dataset,
            "training_params": dict(self.dataset_params),
            "training_sha256": digest([list(image) for image in self.images]),
            "held_out": self.held_out,
            "captures": self.captures,
            "seed": self.seed,
            **({"session": self.place.real.session} if self.place.real else {}),
        }

    @cached_property
    def id(self) -> str:
        """sha256 of the description."""
        return digest(self.description())

    @property
    def name(self) -> str:
        """The folder of its artifact: readable, and different for every description."""
        rows, columns = self.place.spec.shape
        method = self.method.rpartition(":")[2]
        return f"{method}-{self.place.name}-{rows}x{columns}-{self.id[:10]}"


def preparation(study: Study, method: str, params: Mapping[str, Any], place: Condition) -> Preparation | None:
    """What ``method`` has to learn to be shown on ``place``; None for a method that learns nothing.

    On a learned display a method is trained on the display that this one was learned from.
    """
    cls = plugins.find("methods", method, study.folder)
    if not getattr(cls, "trains", False):
        return None
    training = study.training
    dataset = plugins.build("datasets", training.dataset, dict(training.params), study.folder)
    return Preparation(
        method=method,
        version=int(getattr(cls, "version", 1)),
        params=params,
        folder=study.folder,
        place=place.learned.place if place.learned else place,
        dataset=training.dataset,
        dataset_params=training.params,
        images=tuple((item, dataset.digest(item)) for item in dataset.items()),
        held_out=training.held_out,
        captures=training.captures,
        seed=study.seed,
    )


def check_unseen(needed: Mapping[str, Preparation], targets: list[tuple[str, str]]) -> None:
    """Refuse a study that scores an image it trains on. targets: name and digest of each. UserError names the image."""
    scored = {sha256: name for name, sha256 in targets}
    for one in needed.values():
        for item, sha256 in one.images:
            if sha256 in scored:
                raise UserError(f"training image '{item}' is the scored target '{scored[sha256]}'; train on others")
