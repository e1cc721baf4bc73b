"""The stage sheet of a bench: one picture of everything between a phase and a capture (``holoeval show``)."""

from __future__ import annotations

import io
import itertools
from pathlib import Path

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import torch
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
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
from ...display.simulated.pipeline import ChannelMaps, SimulatedBench
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
    bench = workbench.bench
    with plt.rc_context({"font.size": 9, "axes.titlesize": 10}):
        figure, axes = plt.subplots(4, 5, figsize=(17, 13))
        figure.subplots_adjust(**MARGINS)  # a layout engine draws everything once more
        _panel_stages(axes.flat[:6], bench)
        _field_stages(axes.flat[6:14], bench)
        _chart(axes.flat[14:19], workbench)
        _effects(axes.flat[19], bench)
    figure.suptitle(f"{bench.profile.name}, version {bench.profile.version}: {bench.profile.description}\n{note}")
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.suffix == ".png":
        _save_small(figure, path, source)
    else:
        figure.savefig(path, metadata=METADATA[path.suffix])
    plt.close(figure)
    return path


def _save_small(figure: Figure, path: Path, source: str) -> None:
    """A PNG of few colours, with a note of what it is drawn from."""
    drawn, known = io.BytesIO(), PngInfo()
    figure.savefig(drawn, format="png", dpi=DPI)
    if source:
        known.add_text("Description", source)
    few = _of_few_colours(np.asarray(Image.open(drawn).convert("RGB")))
    few.save(path, optimize=True, dpi=(DPI, DPI), pnginfo=known)


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


def _index(bench: SimulatedBench) -> int:
    """Of the colour that stands for all in pictures of one: green of three."""
    return len(bench.channels) // 2


def _colours(bench: SimulatedBench) -> tuple[str, ...]:
    """Of the lines of each wavelength; of a single one, the colour that it is nearest to."""
    if len(bench.spec.wavelengths) > 1:
        return COLOURS
    return (COLOURS[sum(bench.spec.wavelengths[0] < bound for bound in BOUNDS)],)


def _middle(bench: SimulatedBench) -> ChannelMaps:
    return bench.channels[_index(bench)]


def _named(bench: SimulatedBench) -> str:
    """Which of several colours a picture is of, for its title."""
    return ", green" if len(bench.channels) > 1 else ""


def _picture(
    axis: Axes,
    image: Tensor,
    title: str,
    unit: str,
    cmap: str = "viridis",
    extent: tuple[float, float, float, float] | None = None,
    axes: tuple[str, str] = ("column [px]", "row [px]"),
) -> None:
    drawn = axis.imshow(image.numpy(), cmap=cmap, interpolation="nearest", extent=extent)
    axis.set_title(title)
    axis.set(xlabel=axes[0], ylabel=axes[1])
    axis.figure.colorbar(drawn, ax=axis, label=unit, fraction=0.046)


def _panel_stages(axes: list[Axes], bench: SimulatedBench) -> None:
    """Look-up table, its gain map, crosstalk, wrap edge, pixel aperture and flicker."""
    profile = bench.profile
    levels = torch.arange(2**profile.panel.bits)
    for channel, (colour, wavelength) in enumerate(zip(_colours(bench), bench.spec.wavelengths, strict=True)):
        curve = profile.lut.curve(profile.panel.bits, channel) / torch.pi
        axes[0].plot(levels, curve, color=colour, label=f"{1e9 * wavelength:.0f} nm")
    axes[0].plot(levels, 2 * levels / 2**profile.panel.bits, "k:", label="nominal")
    axes[0].set(title="look-up table", xlabel="gray level", ylabel="phase [pi rad]")
    axes[0].legend(fontsize=8)
    _picture(axes[1], _middle(bench).light.lut_gain, f"phase gain over the panel{_named(bench)}", "relative gain")
    width, _ = profile.crosstalk.widths(_index(bench))
    axes[2].plot(*profile.crosstalk.kernel(channel=_index(bench)))
    axes[2].set(title=f"crosstalk, {width:g} px", xlabel="offset [px]", ylabel="share of a pixel's phase")
    _wrap_edge(axes[3], bench)
    aperture = profile.aperture or PixelAperture()
    active = aperture.active_share(bench.samples).reshape(bench.samples, bench.samples)
    sub = ("sub-sample column", "sub-sample row")
    _picture(axes[4], active, "active share of the sub-samples of a pixel", "share of area", "gray", axes=sub)
    draw = _middle(bench).geometry.generator("sheet")
    axes[5].plot([profile.flicker.gain(draw) for _ in range(100)])
    axes[5].set(title=f"flicker, {100 * profile.flicker.rms:g} % rms", xlabel="frame", ylabel="relative phase gain")


def _wrap_edge(axis: Axes, bench: SimulatedBench) -> None:
    """A ramp as commanded and as it stands on the panel, along a line of sub-samples: the bench's blaze, if any."""
    cycles = max(bench.profile.panel.blaze, key=abs)
    along = 0 if cycles and cycles == bench.profile.panel.blaze[0] else 1
    shape, count = bench.spec.shape, 30 * bench.samples
    turns = torch.remainder((cycles or RAMP) * torch.arange(shape[along], dtype=torch.float64), 1.0)
    line = 2 * torch.pi * turns.float()
    ramp = (line[:, None] if along == 0 else line[None]).expand(shape)
    level = torch.remainder(torch.round(ramp / (2 * torch.pi) * 2**bench.spec.bits), 2**bench.spec.bits)
    phase = bench.profile.lut.phase(level, bench.spec.bits, _middle(bench).light.lut_gain, _index(bench))
    fine = bench.profile.crosstalk.apply(phase, _middle(bench).light.weights).view(bench.samples, bench.samples, *shape)
    middle = bench.samples // 2
    seen = fine[:, middle, :, shape[1] // 2] if along == 0 else fine[middle, :, shape[0] // 2]
    places = (torch.arange(count) - (bench.samples - 1) / 2) / bench.samples
    axis.step(torch.arange(30), 2 * turns[:30], where="mid", label="commanded")
    axis.step(places, seen.T.reshape(-1)[:count] / torch.pi, where="mid", label="on the panel")
    named = f"the blaze, {cycles:g} cycles / px" if cycles else f"a test ramp, {RAMP:g} cycles / px (no blaze here)"
    axis.set(title=named, xlabel=f"{('row', 'column')[along]} [px]", ylabel="phase [pi rad]")
    axis.legend(fontsize=8)


def _field_stages(axes: list[Axes], bench: SimulatedBench) -> None:
    """Spectrum, illumination, dirt, pupil with aberration, stray light, sensor response."""
    profile, maps = bench.profile, _middle(bench)
    _spectrum(axes[0], bench)
    light = profile.illumination.panel(maps.geometry)
    _picture(axes[1], light.abs(), f"illumination amplitude{_named(bench)}", "relative amplitude")
    _picture(axes[2], light.angle(), f"illumination phase{_named(bench)}", "phase [rad]", "twilight")
    _picture(axes[3], profile.coherent_noise.panel(maps.geometry).abs(), "dust and scratches at the panel", "amplitude")
    plane = profile.coherent_noise.plane(maps.geometry)
    clean = torch.ones(bench.spec.shape)
    _picture(axes[4], clean if plane is None else plane.real, "dust on the plane before the image", "amplitude")
    _aberration(axes[5], bench)
    _veil(axes[6], bench)
    _picture(axes[7], bench.response, "sensor response: vignetting, fixed pattern", "relative response", "gray")


def _aberration(axis: Axes, bench: SimulatedBench) -> None:
    """In the pupil: the iris, or before a lens the panel, where an error of the distance is seen too."""
    profile, geometry = bench.profile, _middle(bench).geometry
    if bench.spec.plane == "fourier":
        wave = profile.propagation.lens_phase(geometry) / (2 * torch.pi)
        return _picture(axis, wave, f"defocus and aberration at the panel{_named(bench)}", "waves")
    f = torch.linspace(-0.5, 0.5, 201, dtype=torch.float64) / bench.spec.pitch
    fy, fx = f[:, None], f[None, :]
    wave = profile.propagation.pupil_phase(fy, fx, geometry, profile.panel.pupil) / (2 * torch.pi)
    inside = iris(fy, fx, bench.spec.pitch, profile.panel.pupil) > 0.5
    seen, title = torch.where(inside, wave, torch.nan), f"aberration in the iris{_named(bench)}"
    return _picture(axis, seen, title, "waves", extent=(-0.5, 0.5, 0.5, -0.5), axes=AT_IRIS)


def _spectrum(axis: Axes, bench: SimulatedBench) -> None:
    """The wavelengths of each colour, as offsets from the nominal one; colours of the same offset lie in each other."""
    for lines, colour, width in zip(bench.lines, _colours(bench), (9, 5, 2), strict=False):
        offsets = [1e9 * line.geometry.detuning for line in lines]
        axis.vlines(offsets, 0, [line.power for line in lines], color=colour, linewidth=width)
    axis.set(title="spectrum of the source", xlabel="offset from the nominal wavelength [nm]", ylabel="power of a line")


def _veil(axis: Axes, bench: SimulatedBench) -> None:
    """What stray light makes of a bright half of the image, along one row."""
    stage, (height, width) = bench.profile.stray_light, bench.spec.shape
    half = torch.zeros(height, width)
    half[:, width // 2 :] = 1
    row = stage.image(half, bench.profile, _middle(bench).geometry)[height // 2]
    axis.plot(torch.arange(width), half[height // 2], "k:", label="without")
    axis.plot(torch.arange(width), row, label="with")
    axis.set(
        title=f"stray light, {100 * stage.veil(_index(bench))[0]:g} %",
        xlabel="column [px]",
        ylabel="relative intensity",
    )
    axis.legend(fontsize=8)


def _chart(axes: list[Axes], workbench: CalibratedBench) -> None:
    """A flat phase, a chart's light in the plane of the iris, sensor noise, and its capture beside its target."""
    spec, bench = workbench.spec, workbench.bench
    flat = torch.zeros(len(spec.wavelengths), *spec.shape)
    with torch.no_grad():
        light = bench.image(flat)[_index(bench)]
    _picture(axes[0], light, f"image plane under a flat phase{_named(bench)}", "intensity / incident", "magma")
    levels = torch.linspace(0, 1, 60)
    sensor, draw = bench.profile.sensor, _middle(bench).geometry.generator("sheet noise")
    patch = torch.ones(40, 40)
    normal = torch.randn(patch.shape, generator=draw)
    noise = [float(sensor.expose(patch * level, sensor.full_well, patch, normal).std()) for level in levels]
    axes[2].plot(levels * sensor.full_well, noise)
    axes[2].set(title="sensor noise", xlabel="signal [electrons]", ylabel="standard deviation [DN]")
    chart = Charts(names=("tv_lines",))
    target = chart.load("tv_lines", spec.region.shape, len(spec.wavelengths))
    method = Wirtinger(iterations=STEPS)
    phase = method.solve(target[None], workbench.for_method(method, "wirtinger", target, "chart", 0))[0]
    _zero_order(axes[1], bench, phase[_index(bench)])
    shot = workbench.photograph(phase, target, "chart", 0)
    psnr = score(shot.image, target, metrics=("psnr",))["psnr_linear"]
    for axis, image, title in (
        (axes[3], target, "chart: target"),
        (axes[4], match(shot.image, target)[0], f"chart: capture, {STEPS} steps of Wirtinger, {psnr:.1f} dB"),
    ):
        picture = srgb_encode(torch.as_tensor(image)).permute(1, 2, 0).float().numpy()
        axis.imshow(picture, cmap="gray", interpolation="nearest")
        axis.set(title=title, xlabel="column [px]", ylabel="row [px]")


def _zero_order(axis: Axes, bench: SimulatedBench, phase: Tensor) -> None:
    """The power of a hologram's light in the plane of the iris, with the iris and the place of the zero order. In a
    Fourier plane, that is the picture, with the region in the place of the iris.

    phase: ``(H, W)`` [rad]. The picture is centred, so that a blaze moves the zero order to its negative.
    """
    profile, pitch = bench.profile, bench.spec.pitch
    with torch.no_grad():
        field = _middle(bench).light.in_torch(phase, 1.0).mean((0, 1))
    power = torch.fft.fftshift(torch.fft.fft2(field)).abs() ** 2
    decibels = 10 * torch.log10((power / power.max()).clamp(min=1e-5))
    _picture(axis, decibels, "", "power / its peak [dB]", "gray", (-0.5, 0.5, 0.5, -0.5), AT_IRIS)
    if profile.panel.pupil and bench.spec.plane == "fresnel":
        axis.add_patch(Circle((0, 0), profile.panel.pupil / 2, fill=False, edgecolor="tab:orange"))
    if bench.spec.plane == "fourier":
        region, (rows, columns), step = bench.spec.region, bench.spec.shape, bench.spec.step(_index(bench))
        corner = (step * (region.left - columns // 2), step * (region.top - rows // 2))
        axis.add_patch(Rectangle(corner, step * region.width, step * region.height, fill=False, edgecolor="tab:orange"))
    share = float(_middle(bench).light.unmodulated.mean().abs() ** 2)
    up, across = (-cycles for cycles in profile.panel.blaze)
    if share < SMALLEST_SHARE:
        axis.set_title("light in the iris plane: no zero order")
        return
    passed = float(iris(torch.tensor(up / pitch), torch.tensor(across / pitch), pitch, profile.panel.pupil)) > 0.5
    axis.plot(across, up, marker="o", markersize=14, markerfacecolor="none", markeredgecolor="tab:cyan")
    if bench.spec.plane == "fourier":
        axis.set_title(f"Fourier plane, zero order + dead area: {100 * share:.0f} %")
        return
    axis.set_title(f"zero order + dead area: {100 * share:.0f} %, {'pass' if passed else 'stopped by'} the iris")


def _effects(axis: Axes, bench: SimulatedBench) -> None:
    """Every effect of the bench, in the order in which light meets them."""
    names = [effect.name.replace("_", " ") for effect in bench.profile.effects()]
    axis.set_axis_off()
    axis.set_title("effects, in the order of the light")
    half = -(-len(names) // 2)
    for left, start in ((-0.2, 0), (0.45, half)):
        numbered = enumerate(names[start : start + half], start=start + 1)
        words = "\n".join(f"{number}  {name}" for number, name in numbered)
        axis.text(left, 0.97, words, va="top", linespacing=1.3, parse_math=False, transform=axis.transAxes)
