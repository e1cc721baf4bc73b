"""Which network approximates the display: the parameters under ``network:``, and the modules they stand for."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Annotated, Literal

from annotated_types import Interval
from torch import Tensor, nn

from ...core.errors import UserError
from ..learned.weights import draw_weights, start_at_zero
from .baselines import Identity, Pix2Pix, Pix2PixHD, UNet
from .discriminator import MultiScaleDiscriminator, PatchDiscriminator
from .generator import Generator

Name = Literal["proposed", "unet", "pix2pix", "pix2pixhd", "identity"]
Discriminator = PatchDiscriminator | MultiScaleDiscriminator

PIX2PIX_DEVIATION = 0.02  # of the first weights (Isola et al., appendix)
HALVED = ("unet", "pix2pixhd")  # have half the filters, Section 6.1
PUBLISHED_HALVINGS = 4  # of the resolution in these two
SWITCHES = ("dropout", "full_resolution_stage", "plain_ends", "skip_after_activation")  # of the generator


class FromIdentity(nn.Module):
    """An image and what a network adds to it: nothing at first, since Algorithm 1 begins with D = Id.

    Light is not negative: what falls below zero is zero. The gradient is passed on there as if it were not cut, so that
    neither the training nor a retrieval loses a pixel that was predicted black; the paper names no last activation.
    """

    def __init__(self, network: nn.Module) -> None:
        super().__init__()
        self.network = start_at_zero(network)

    def forward(self, ideal: Tensor) -> Tensor:
        """``(B, C, h, w)`` linear light to the same."""
        light: Tensor = ideal + self.network(ideal)
        return light + (light.clamp_min(0) - light).detach()


@dataclass(frozen=True)
class Network:
    """Generator and discriminator by name and size.

    Chakravarthula et al. 2020, Sections 4.3.1 and 6.1.

    Parameters
    ----------
    name : str
        The proposed network or one of Table 1.
    preset : {"small", "paper"}
        "paper" is what is published; "small" (not in the paper) has a quarter of the filters and fewer levels, for
        small panels and a CPU.
    levels : int, optional
        Halvings of the resolution; by default 5 in "small" and 8 in "paper", and 4 for U-Net and Pix2PixHD.
    width : int, optional
        Filters of the first level, doubled from level to level; by default 16 in "small" and 64 in "paper". U-Net and
        Pix2PixHD have half of them, as in Section 6.1.
    conditional : bool
        The discriminator sees the ideal image too. For the proposed network only, as are the next four.
    dropout : bool
        Drop half the features of the three innermost decoding layers while training, as Pix2Pix does.
    full_resolution_stage : bool
        Make the image in a convolution at full resolution; Pix2Pix makes it in the last transposed convolution.
    plain_ends : bool
        Leave instance normalisation out of the first two encoding and the last two decoding layers; Pix2Pix leaves it
        out of the first, and where the image is made.
    skip_after_activation : bool
        Branch skip connections off after the encoder's activation; Pix2Pix does before.

    Raises
    ------
    UserError
        Where one of the last five is set for another network.
    """

    name: Name = "proposed"
    preset: Literal["small", "paper"] = "small"
    levels: Annotated[int, Interval(ge=1, le=10)] | None = None
    width: Annotated[int, Interval(ge=2, le=256)] | None = None
    conditional: bool = True
    dropout: bool = False
    full_resolution_stage: bool = True
    plain_ends: bool = True
    skip_after_activation: bool = True

    def __post_init__(self) -> None:
        for field in fields(self):
            if (
                self.name != "proposed"
                and field.name in ("conditional", *SWITCHES)
                and getattr(self, field.name) != field.default
            ):
                raise UserError(f"network '{self.name}' has no '{field.name}'; it is for the network 'proposed'")

    def generator(self, inputs: int, outputs: int) -> nn.Module:
        """The generator for intensities with so many channels; its weights come from torch's global random numbers."""
        levels, width = self.halvings, self.filters
        if self.name == "identity":
            if inputs != outputs:
                raise UserError(f"network 'identity' needs as many inputs as outputs, got {inputs} and {outputs}")
            return Identity()
        if self.name == "unet":
            return draw_weights(UNet(inputs, outputs, levels, width), None)
        if self.name == "pix2pix":
            return draw_weights(Pix2Pix(inputs, outputs, levels, width), PIX2PIX_DEVIATION)
        if self.name == "pix2pixhd":
            return draw_weights(Pix2PixHD(inputs, outputs, levels, width), PIX2PIX_DEVIATION)
        switches = {name: getattr(self, name) for name in SWITCHES}
        return draw_weights(Generator(inputs, outputs, levels, width, **switches), PIX2PIX_DEVIATION)

    def discriminator(self, channels: int) -> Discriminator | None:
        """The discriminator of images with so many channels, and of ideal intensities with as many where it is
        conditional; None for networks that are published without."""
        seen = channels if self.conditional else 0
        if self.name == "pix2pixhd":
            return draw_weights(MultiScaleDiscriminator(channels, seen, self.filters), PIX2PIX_DEVIATION)
        if self.name in ("proposed", "pix2pix"):
            flat = 3 if self.name == "proposed" else 2
            return draw_weights(PatchDiscriminator(channels, seen, self.filters, flat=flat), PIX2PIX_DEVIATION)
        return None

    @property
    def halvings(self) -> int:
        """How often the generator halves the resolution."""
        preset = {"small": 5, "paper": 8}[self.preset]
        return self.levels or (PUBLISHED_HALVINGS if self.name in HALVED else preset)

    @property
    def filters(self) -> int:
        """Filters of the first level of generator and discriminator."""
        width = self.width or {"small": 16, "paper": 64}[self.preset]
        return width // 2 if self.name in HALVED else width
