"""The photographs that scikit-image ships inside its package: the images that are scored by default."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

from annotated_types import Interval
from torch import Tensor

from .base import chosen, fit, known, with_channels
from .shipped import content_digest, decoded

# in the order in which `count` takes them: six in colour, then the gray ones
NAMES = (
    *("astronaut", "coffee", "chelsea", "rocket", "hubble_deep_field", "retina"),
    *("camera", "brick", "grass", "gravel", "text"),
)


@dataclass(frozen=True)
class Photographs:
    """Photographs that ship inside scikit-image; nothing is downloaded.

    van der Walt et al., "scikit-image: image processing in Python", PeerJ 2:e453, 2014.

    In this order: astronaut, coffee, chelsea, rocket, hubble_deep_field and retina, in colour; camera, brick, grass,
    gravel and text, gray and replicated to three channels. All are decoded as sRGB: rocket carries an Adobe RGB
    profile, which is ignored, as scikit-image does. Most have 400 to 512 rows, chelsea 300 and text 172; a larger
    region enlarges them.

    count: the first so many of them; null for all. names: these instead, in this order (count is then not used).
    """

    count: Annotated[int, Interval(ge=1, le=len(NAMES))] | None = 8
    names: tuple[str, ...] | None = None

    training: ClassVar[bool] = False

    def __post_init__(self) -> None:
        """UserError for an unknown or repeated name."""
        if self.names is not None:
            chosen("photograph", self.names, NAMES)

    def items(self) -> list[str]:
        """The names, in order."""
        return list(NAMES)[: self.count] if self.names is None else list(self.names)

    def load(self, item: str, shape: tuple[int, int], channels: int = 3) -> Tensor:
        """A photograph as ``(channels, *shape)`` linear light in [0, 1], cropped and resized by ``base.fit``."""
        return with_channels(fit(decoded(known("photograph", item, self.items())), shape), channels)

    def digest(self, item: str) -> str:
        """SHA-256 of the file inside scikit-image."""
        return content_digest(known("photograph", item, self.items()))
