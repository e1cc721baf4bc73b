"""The stage sheet of a bench: one picture of everything between a phase and a capture (``holoeval show``)."""

from __future__ import annotations

import io
import itertools
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import torch
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.patches import Circle, Rectangle
from numpy.typing import NDArray
from PIL import Image
from PIL.PngImagePlugin import PngInfo
from scipy.spatial import KDTree
from torch import Tensor

from ...core.errors import UserError
from ...datasets.charts import Charts
from ...display import load_profile
from ...display.calibrated import CalibratedBench
from ...display.resolution import refuse_far
from ...display.simulated.stages import PixelAperture
from ...methods.wirtinger import Wirtinger
from ...metrics import match, score
from ...optics import srgb_encode
from ...optics.convolution import iris
from ...study.opening import open_bench
from .look import METADATA

VERSION = 6  # of the drawing: sheets of another are drawn again
DPI = 75  # of a PNG: 1275 x 975 pixels, the width of a page of pictures
COLOURS = ("tab:red", "tab:green", "tab:blue")
BOUNDS = (590e-9, 490e-9)  # m, between these colours
MARGINS = {"left": 0.045, "right": 0.955, "bottom": 0.045, "top": 0.92, "wspace": 0.66, "hspace": 0.38}
RAMP = 0.11  # cycles a pixel of the test ramp of a bench without a blaze
# A PNG of so many colours of each kind, and of a cube for captures, is small enough to look at in a browser.
SHADES = {"gray": 44, "viridis": 52, "magma": 40, "twilight": 40}
LINES = (*COLOURS, "tab:orange", "tab:cyan")
CUBE = (0, 85, 170, 255)
PIXELS = ("column [px]", "row [px]")
BAND = (-0.5, 0.5, 0.5, -0.5)
AT_IRIS = ("horizontal [cycles / px]", "vertical [cycles / px]")
SMALLEST_SHARE = 0.001  # of the light, from which on a zero order is drawn
STEPS = 60  # of the hologram of the chart: it shows what the bench does, not what the method can


def draw_sheet(name: str, panel: tuple[int, int] | None = None, output: Path | None = None) -> Path:
    """Draw the stages of a profile on a panel of (rows, columns), 256 x 256 by default; returns the PNG's path."""
    profile = load_profile(name)
    shape = panel or profile.usual
    path = output or Path(f"stages-{profile.name}.png")
    if path.suffix not in (".png", ".pdf", ".svg"):
        raise UserError(f"--output {path}: a picture is written as .png, .pdf or .svg")
    refuse_far(profile.spec(shape), profile.panel.distance)
    return save_sheet(open_bench(profile, shape), profile.scaling_note(shape), path)


def drawn_from(path: Path) -> str:
    """What a sheet says it was drawn from, see ``save_sheet``; empty where there is none or it says nothing."""
    try:
        with Image.open(path) as picture:
            return str(picture.info.get("Description", ""))
    except (OSError, SyntaxError, ValueError):  # a damaged picture is drawn anew
        return ""


def save_sheet(workbench: CalibratedBench, note: str, path: Path, source: str = "") -> Path:
    """Write the sheet of an open bench; ``note`` says how its panel was scaled. A few seconds at 256 x 256.

    source: what it is drawn from, kept in the file (PNG), so that it need not be drawn again.
    """
    profile = workbench.bench.profile
    with plt.rc_context({"font.size": 9, "axes.titlesize": 10}):
        figure, axes = plt.subplots(4, 5, figsize=(17, 13))
        figure.subplots_adjust(**MARGINS)  # a layout engine draws everything once more
        _Sheet(workbench, iter(axes.flat)).draw()
    figure.suptitle(f"{profile.name}, version {profile.version}: {profile.description}\n{note}")
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.suffix == ".png":
        drawn, known = io.BytesIO(), PngInfo()
        figure.savefig(drawn, format="png", dpi=DPI)
        if source:
            known.add_text("Description", source)
        few = _of_few_colours(np.asarray(Image.open(drawn).convert("RGB")))
        few.save(path, optimize=True, dpi=(DPI, DPI), pnginfo=known)
    else:
        figure.savefig(path, metadata=METADATA[path.suffix])
    plt.close(figure)
    return path


def _of_few_colours(pixels: NDArray[np.uint8]) -> Image.Image:
    """Pixels ``(h, w, 3)``, each with the nearest of the colours that all sheets share."""
    ramps = (matplotlib.colormaps[name](np.linspace(0, 1, count))[:, :3] for name, count in SHADES.items())
    named = np.round(255 * np.concatenate([*ramps, [to_rgb(colour) for colour in LINES]]))
    palette = np.concatenate([named, [*itertools.product(CUBE, repeat=3)]]).astype(np.uint8)
    packed = pixels.astype(np.uint32) @ np.array([1 << 16, 1 << 8, 1], dtype=np.uint32)
    colours, places = np.unique(packed, return_inverse=True)
    levels = np.stack([colours >> 16, colours >> 8 & 255, colours & 255], axis=1)
    nearest = np.asarray(KDTree(palette).query(levels)[1], dtype=np.uint8)
    picture = Image.fromarray(nearest[places].reshape(packed.shape))  # gray, until it has a palette
    picture.putpalette(palette.tobytes())
    return picture


class _Sheet:
    """The panels of a sheet, in the order of the light; pictures of one colour are those of the middle one."""

    def __init__(self, workbench: CalibratedBench, axes: Iterator[Axes]) -> None:
        self.workbench, self.axes, self.bench, self.spec = workbench, axes, workbench.bench, workbench.spec
        self.profile, self.index = self.bench.profile, len(self.bench.channels) // 2
        self.light, self.geometry = self.bench.channels[self.index].light, self.bench.channels[self.index].geometry
        self.named = ", green"
        self.colours: tuple[str, ...] = COLOURS
        if len(self.spec.wavelengths) == 1:  # in the colour that it is nearest to
            nearest = sum(self.spec.wavelengths[0] < bound for bound in BOUNDS)
            self.named, self.colours = "", COLOURS[nearest : nearest + 1]

    def draw(self) -> None:
        """Draw all panels."""
        profile, geometry, light, spec = self.profile, self.geometry, self.light, self.spec
        bits, samples, levels = profile.panel.bits, self.bench.samples, torch.arange(2**profile.panel.bits)
        axis = self._axis("look-up table", "gray level", "phase [pi rad]")
        for channel, (colour, wavelength) in enumerate(zip(self.colours, spec.wavelengths, strict=True)):
            curve = profile.lut.curve(bits, channel) / torch.pi
            axis.plot(levels, curve, color=colour, label=f"{1e9 * wavelength:.0f} nm")
        axis.plot(levels, 2 * levels / 2**bits, "k:", label="nominal")
        axis.legend(fontsize=8)
        self._picture(light.lut_gain, f"phase gain over the panel{self.named}", "relative gain")
        width, _ = profile.crosstalk.widths(self.index)
        axis = self._axis(f"crosstalk, {width:g} px", "offset [px]", "share of a pixel's phase")
        axis.plot(*profile.crosstalk.kernel(channel=self.index))
        self._wrap_edge()
        active = (profile.aperture or PixelAperture()).active_share(samples).reshape(samples, samples)
        title = "active share of the sub-samples of a pixel"
        self._picture(active, title, "share of area", "gray", names=("sub-sample column", "sub-sample row"))
        draw = geometry.generator("sheet")
        axis = self._axis(f"flicker, {100 * profile.flicker.rms:g} % rms", "frame", "relative phase gain")
        axis.plot([profile.flicker.gain(draw) for _ in range(100)])
        self._spectrum()
        wave = profile.illumination.panel(geometry)
        self._picture(wave.abs(), f"illumination amplitude{self.named}", "relative amplitude")
        self._picture(wave.angle(), f"illumination phase{self.named}", "phase [rad]", "twilight")
        dust = profile.coherent_noise.panel(geometry).abs()
        self._picture(dust, "dust and scratches at the panel", "amplitude")
        plane = profile.coherent_noise.plane(geometry)
        clean = torch.ones(spec.shape)
        self._picture(clean if plane is None else plane.real, "dust on the plane before the image", "amplitude")
        self._aberration()
        self._veil()
        title = "sensor response: vignetting, fixed pattern"
        self._picture(self.bench.response, title, "relative response", "gray")
        self._chart()
        self._effects()

    def _axis(self, title: str, xlabel: str, ylabel: str) -> Axes:
        """The next panel."""
        axis = next(self.axes)
        axis.set(title=title, xlabel=xlabel, ylabel=ylabel)
        return axis

    def _picture(
        self,
        image: Tensor,
        title: str,
        unit: str,
        cmap: str = "viridis",
        extent: tuple[float, float, float, float] | None = None,
        names: tuple[str, str] = PIXELS,
    ) -> Axes:
        axis = self._axis(title, *names)
        drawn = axis.imshow(image.numpy(), cmap=cmap, interpolation="nearest", extent=extent)
        axis.figure.colorbar(drawn, ax=axis, label=unit, fraction=0.046)
        return axis

    def _wrap_edge(self) -> None:
        """A ramp as commanded and as it stands on the panel, along a line of sub-samples: the bench's blaze, if any."""
        profile, (rows, columns), samples = self.profile, self.spec.shape, self.bench.samples
        cycles = max(profile.panel.blaze, key=abs)
        down = bool(cycles) and cycles == profile.panel.blaze[0]
        turns = torch.remainder((cycles or RAMP) * torch.arange(rows if down else columns, dtype=torch.float64), 1.0)
        line = 2 * torch.pi * turns.float()
        ramp = (line[:, None] if down else line[None]).expand(rows, columns)
        level = torch.remainder(torch.round(ramp / (2 * torch.pi) * 2**self.spec.bits), 2**self.spec.bits)
        phase = profile.lut.phase(level, self.spec.bits, self.light.lut_gain, self.index)
        fine = profile.crosstalk.apply(phase, self.light.weights).view(samples, samples, rows, columns)
        seen = fine[:, samples // 2, :, columns // 2] if down else fine[samples // 2, :, rows // 2]
        places = (torch.arange(30 * samples) - (samples - 1) / 2) / samples
        named = f"the blaze, {cycles:g} cycles / px" if cycles else f"a test ramp, {RAMP:g} cycles / px (no blaze here)"
        axis = self._axis(named, f"{'row' if down else 'column'} [px]", "phase [pi rad]")
        axis.step(torch.arange(30), 2 * turns[:30], where="mid", label="commanded")
        axis.step(places, seen.T.reshape(-1)[: 30 * samples] / torch.pi, where="mid", label="on the panel")
        axis.legend(fontsize=8)

    def _aberration(self) -> None:
        """In the pupil: the iris, or before a lens the panel, where an error of the distance is seen too."""
        stage, pitch, pupil = self.profile.propagation, self.spec.pitch, self.profile.panel.pupil
        if self.spec.plane == "fourier":
            wave = stage.lens_phase(self.geometry) / (2 * torch.pi)
            self._picture(wave, f"defocus and aberration at the panel{self.named}", "waves")
            return
        f = torch.linspace(-0.5, 0.5, 201, dtype=torch.float64) / pitch
        fy, fx = f[:, None], f[None, :]
        wave = stage.pupil_phase(fy, fx, self.geometry, pupil) / (2 * torch.pi)
        inside = torch.where(iris(fy, fx, pitch, pupil) > 0.5, wave, torch.nan)
        self._picture(inside, f"aberration in the iris{self.named}", "waves", extent=BAND, names=AT_IRIS)

    def _spectrum(self) -> None:
        """The wavelengths of each colour, as offsets from the nominal one; equal ones lie in each other."""
        axis = self._axis("spectrum of the source", "offset from the nominal wavelength [nm]", "power of a line")
        for lines, colour, width in zip(self.bench.lines, self.colours, (9, 5, 2), strict=False):
            offsets = [1e9 * line.geometry.detuning for line in lines]
            axis.vlines(offsets, 0, [line.power for line in lines], color=colour, linewidth=width)

    def _veil(self) -> None:
        """What stray light makes of a bright half of the image, along one row."""
        stage, (height, width) = self.profile.stray_light, self.spec.shape
        half = torch.zeros(height, width)
        half[:, width // 2 :] = 1
        row = stage.image(half, self.profile, self.geometry)[height // 2]
        title = f"stray light, {100 * stage.veil(self.index)[0]:g} %"
        axis = self._axis(title, "column [px]", "relative intensity")
        axis.plot(torch.arange(width), half[height // 2], "k:", label="without")
        axis.plot(torch.arange(width), row, label="with")
        axis.legend(fontsize=8)

    def _chart(self) -> None:
        """A flat phase, a chart's light in the plane of the iris, sensor noise, and its capture beside its target."""
        spec, sensor = self.spec, self.profile.sensor
        with torch.no_grad():
            light = self.bench.image(torch.zeros(len(spec.wavelengths), *spec.shape))[self.index]
        self._picture(light, f"image plane under a flat phase{self.named}", "intensity / incident", "magma")
        target = Charts(names=("tv_lines",)).load("tv_lines", spec.region.shape, len(spec.wavelengths))
        method = Wirtinger(iterations=STEPS)
        phase = method.solve(target[None], self.workbench.for_method(method, "wirtinger", target, "chart", 0))[0]
        self._zero_order(phase[self.index])
        levels, patch = torch.linspace(0, 1, 60), torch.ones(40, 40)
        normal = torch.randn(patch.shape, generator=self.geometry.generator("sheet noise"))
        noise = [float(sensor.expose(patch * level, sensor.full_well, patch, normal).std()) for level in levels]
        axis = self._axis("sensor noise", "signal [electrons]", "standard deviation [DN]")
        axis.plot(levels * sensor.full_well, noise)
        shot = self.workbench.photograph(phase, target, "chart", 0)
        psnr = score(shot.image, target, metrics=("psnr",))["psnr_linear"]
        capture = f"chart: capture, {STEPS} steps of Wirtinger, {psnr:.1f} dB"
        for image, title in ((target, "chart: target"), (match(shot.image, target)[0], capture)):
            picture = srgb_encode(torch.as_tensor(image)).permute(1, 2, 0).float().numpy()
            self._axis(title, *PIXELS).imshow(picture, cmap="gray", interpolation="nearest")

    def _zero_order(self, phase: Tensor) -> None:
        """The power of a hologram's light in the plane of the iris, with the iris and the place of the zero order. In a
        Fourier plane, that is the picture, with the region in the place of the iris.

        phase: ``(H, W)`` [rad]. The picture is centred, so that a blaze moves the zero order to its negative.
        """
        panel, spec = self.profile.panel, self.spec
        edge: dict[str, Any] = {"fill": False, "edgecolor": "tab:orange"}
        with torch.no_grad():
            field = self.light.in_torch(phase, 1.0).mean((0, 1))
        power = torch.fft.fftshift(torch.fft.fft2(field)).abs() ** 2
        decibels = 10 * torch.log10((power / power.max()).clamp(min=1e-5))
        share = float(self.light.unmodulated.mean().abs() ** 2)
        up, across = (-cycles for cycles in panel.blaze)
        fy, fx = (torch.tensor(cycles / spec.pitch) for cycles in (up, across))
        is_open = float(iris(fy, fx, spec.pitch, panel.pupil)) > 0.5
        title = f"zero order + dead area: {100 * share:.0f} %, {'pass' if is_open else 'stopped by'} the iris"
        if spec.plane == "fourier":
            title = f"Fourier plane, zero order + dead area: {100 * share:.0f} %"
        if share < SMALLEST_SHARE:
            title = "light in the iris plane: no zero order"
        axis = self._picture(decibels, title, "power / its peak [dB]", "gray", BAND, AT_IRIS)
        if spec.plane == "fourier":
            region, (rows, columns), step = spec.region, spec.shape, spec.step(self.index)
            corner = (step * (region.left - columns // 2), step * (region.top - rows // 2))
            axis.add_patch(Rectangle(corner, step * region.width, step * region.height, **edge))
        elif panel.pupil and spec.plane == "fresnel":
            axis.add_patch(Circle((0, 0), panel.pupil / 2, **edge))
        if share >= SMALLEST_SHARE:
            axis.plot(across, up, marker="o", markersize=14, markerfacecolor="none", markeredgecolor="tab:cyan")

    def _effects(self) -> None:
        """Every effect of the bench, in the order in which light meets them."""
        names = [effect.name.replace("_", " ") for effect in self.profile.effects()]
        axis = self._axis("effects, in the order of the light", "", "")
        axis.set_axis_off()
        numbered = [f"{number}  {name}" for number, name in enumerate(names, start=1)]
        half = -(-len(names) // 2)
        for left, words in ((-0.2, numbered[:half]), (0.45, numbered[half:])):
            axis.text(
                left, 0.97, "\n".join(words), va="top", linespacing=1.3, parse_math=False, transform=axis.transAxes
            )
