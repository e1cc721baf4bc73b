"""What a stage of the simulated bench is: where it may act on the light, and what it tells of itself."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

from torch import Tensor

if TYPE_CHECKING:
    from .geometry import Geometry
    from .profile import Profile


@dataclass(frozen=True)
class Effect:
    """One way in which a bench is not ideal. name: what a model's form is a set of; text: it, with its figures."""

    name: str
    text: str


@dataclass(frozen=True)
class Stage:
    """A part of the bench that acts on the light; its dataclass fields are the keys of a profile's YAML.

    A stage overrides the hooks of the places where it acts; the others leave the light as it is. ``hologram``,
    ``spectrum``, ``panel`` and ``transmission`` are asked once, when the bench is built, ``image`` in every frame.

    title, model: the stage's row in the table of docs/bench.md; the model names its source. maps: tensors by the names
    that ``maps.KEYS`` has for the stage, which act in the place of its parameters or beside them.
    """

    title: ClassVar[str]
    model: ClassVar[str]

    maps: Mapping[str, Any] = field(
        default_factory=dict, kw_only=True, repr=False, compare=False, metadata={"key": False}
    )

    def map_of(self, name: str, channel: int) -> Tensor | None:
        """What a map holds for a colour; None where there is none."""
        return self.maps[name][channel] if name in self.maps else None

    def effects(self, profile: Profile) -> Iterator[Effect]:
        """The effects that are switched on in a profile, in the order in which light meets them."""
        yield from ()

    def hologram(self, geometry: Geometry) -> Tensor | None:
        """Phase ``(H, W)`` [rad] that the display adds to every hologram."""
        return None

    def spectrum(self, geometry: Geometry) -> Sequence[tuple[float, Geometry]]:
        """Share of the power and geometry of every line of the source; lines add in intensity."""
        return ((1.0, geometry),)

    def panel(self, geometry: Geometry) -> Tensor | None:
        """Complex amplitude ``(H, W)`` of the light at the panel, which multiplies that of the other stages."""
        return None

    def transmission(self, fy: Tensor, fx: Tensor, geometry: Geometry) -> Tensor | None:
        """Complex factor of the light of spatial frequencies (fy, fx) [1/m] on its way to the image."""
        return None

    def image(self, light: Tensor, profile: Profile, geometry: Geometry) -> Tensor:
        """Intensity ``(n H, n W)`` at the image plane after the stage, n samples a pixel and axis; differentiable.

        Coordinates are those of the panel, before the relay's pose; the first sample is the first pixel's centre.
        """
        return light


def percent(share: float) -> str:
    """A share as a text with three digits."""
    return f"{100 * share:.3g} %"
