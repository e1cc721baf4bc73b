"""The stage sheet of a bench: one picture of everything between a phase and a capture (``holoeval show``)."""

from __future__ import annotations

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import torch
from matplotlib.axes import Axes
from PIL import Image
from torch import Tensor

from ...core.errors import UserError
from ...datasets.charts import Charts
from ...display import load_profile
from ...display.calibrated import CalibratedBench
from ...display.simulated.pipeline import SimulatedBench
from ...display.simulated.stages import PixelAperture
from ...methods.wirtinger import Wirtinger
from ...metrics import match, score
from ...optics import srgb_encode
from ...optics.convolution import iris
from ...study.opening import open_bench

COLOURS = ("tab:red", "tab:green", "tab:blue")
GREEN = 1
MARGINS = {"left": 0.045, "right": 0.955, "bottom": 0.05, "top": 0.92, "wspace": 0.46, "hspace": 0.27}
STEPS = 60  # of the hologram of the chart: it shows what the bench does, not what the method can


def draw_sheet(name: str, panel: tuple[int, int] | None = None, output: Path | None = None) -> Path:
    """Draw the stages of a profile on a panel of (rows, columns), 256 x 256 by default; returns the PNG's path."""
    profile, shape = load_profile(name), panel or (256, 256)
    path = output or Path(f"stages-{profile.name}.png")
    if path.suffix not in (".png", ".pdf", ".svg"):
        raise UserError(f"--output {path}: a picture is written as .png, .pdf or .svg")
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
        figure, axes = plt.subplots(3, 6, figsize=(25, 12))
        figure.subplots_adjust(**MARGINS)  # a layout engine draws everything once more
        _panel_stages(axes.flat[:6], bench)
        _field_stages(axes.flat[6:14], bench)
        _chart(axes.flat[14:], workbench)
    figure.suptitle(f"{bench.profile.name}, version {bench.profile.version}: {bench.profile.description}\n{note}")
    path.parent.mkdir(parents=True, exist_ok=True)
    known = {"Software": None, **({"Description": source} if source else {})}
    figure.savefig(path, dpi=100, metadata=known if path.suffix == ".png" else None)
    plt.close(figure)
    return path


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
    for channel, colour in enumerate(COLOURS):
        axes[0].plot(
            levels, profile.lut.curve(profile.panel.bits, channel) / torch.pi, color=colour, label="RGB"[channel]
        )
    axes[0].plot(levels, 2 * levels / 2**profile.panel.bits, "k:", label="nominal")
    axes[0].set(title="look-up table", xlabel="gray level", ylabel="phase [pi rad]")
    axes[0].legend(fontsize=8)
    _picture(axes[1], bench.channels[GREEN].light.lut_gain, "phase gain over the panel, green", "relative gain")
    offsets, share = profile.crosstalk.kernel()
    axes[2].plot(offsets, share)
    axes[2].set(
        title=f"crosstalk, {profile.crosstalk.width:g} px", xlabel="offset [px]", ylabel="share of a pixel's phase"
    )
    _wrap_edge(axes[3], bench)
    aperture = profile.aperture or PixelAperture()
    active = aperture.active_share(bench.samples).reshape(bench.samples, bench.samples)
    sub = ("sub-sample column", "sub-sample row")
    _picture(axes[4], active, "active share of the sub-samples of a pixel", "share of area", "gray", axes=sub)
    draw = bench.channels[GREEN].geometry.generator("sheet")
    axes[5].plot([profile.flicker.gain(draw) for _ in range(100)])
    axes[5].set(title=f"flicker, {100 * profile.flicker.rms:g} % rms", xlabel="frame", ylabel="relative phase gain")


def _wrap_edge(axis: Axes, bench: SimulatedBench) -> None:
    """A linear phase ramp as commanded and as it stands on the panel, along one row of sub-samples."""
    height, width = bench.spec.shape
    ramp = (2 * torch.pi * 0.11 * torch.arange(width, dtype=torch.float32)).expand(height, width)
    level = torch.remainder(torch.round(ramp / (2 * torch.pi) * 2**bench.spec.bits), 2**bench.spec.bits)
    phase = bench.profile.lut.phase(level, bench.spec.bits, bench.channels[GREEN].light.lut_gain, GREEN)
    fine = bench.profile.crosstalk.apply(phase, bench.crosstalk)[:, height // 2]
    row = fine.reshape(bench.samples, bench.samples, width)[bench.samples // 2].T.reshape(-1)
    count = 30 * bench.samples
    columns = (torch.arange(count) - (bench.samples - 1) / 2) / bench.samples
    axis.step(torch.arange(30), torch.remainder(ramp[0, :30], 2 * torch.pi) / torch.pi, where="mid", label="commanded")
    axis.plot(columns, row[:count] / torch.pi, label="on the panel")
    axis.set(title="a blaze after look-up table and crosstalk", xlabel="column [px]", ylabel="phase [pi rad]")
    axis.legend(fontsize=8)


def _field_stages(axes: list[Axes], bench: SimulatedBench) -> None:
    """Spectrum, illumination, dirt, pupil with aberration, stray light, sensor response."""
    profile, maps = bench.profile, bench.channels[GREEN]
    _spectrum(axes[0], bench)
    axes = axes[1:]
    light = profile.illumination.panel(maps.geometry)
    _picture(axes[0], light.abs(), "illumination amplitude, green", "relative amplitude")
    _picture(axes[1], light.angle(), "illumination phase, green", "phase [rad]", "twilight")
    _picture(axes[2], profile.coherent_noise.panel(maps.geometry).abs(), "dust and scratches at the panel", "amplitude")
    plane = profile.coherent_noise.plane(maps.geometry)
    clean = torch.ones(bench.spec.shape)
    _picture(axes[3], clean if plane is None else plane.real, "dust on the plane before the image", "amplitude")
    f = torch.linspace(-0.5, 0.5, 201, dtype=torch.float64) / bench.spec.pitch
    fy, fx = f[:, None], f[None, :]
    wave = profile.propagation.pupil_phase(fy, fx, maps.geometry, profile.panel.pupil) / (2 * torch.pi)
    inside = iris(fy, fx, bench.spec.pitch, profile.panel.pupil) > 0.5
    _picture(
        axes[4],
        torch.where(inside, wave, torch.nan),
        "aberration in the iris, green",
        "waves",
        extent=(-0.5, 0.5, 0.5, -0.5),
        axes=("horizontal [cycles / px]", "vertical [cycles / px]"),
    )
    _veil(axes[5], bench)
    _picture(axes[6], bench.response, "sensor response: vignetting, fixed pattern", "relative response", "gray")


def _spectrum(axis: Axes, bench: SimulatedBench) -> None:
    """The wavelengths of each colour, as offsets from the nominal one; colours of the same offset lie in each other."""
    for lines, colour, width in zip(bench.lines, COLOURS, (9, 5, 2), strict=False):
        offsets = [1e9 * line.geometry.detuning for line in lines]
        axis.vlines(offsets, 0, [line.power for line in lines], color=colour, linewidth=width)
    axis.set(title="spectrum of the source", xlabel="offset from the nominal wavelength [nm]", ylabel="power of a line")


def _veil(axis: Axes, bench: SimulatedBench) -> None:
    """What stray light makes of a bright half of the image, along one row."""
    stage, (height, width) = bench.profile.stray_light, bench.spec.shape
    half = torch.zeros(height, width)
    half[:, width // 2 :] = 1
    row = stage.image(half, bench.profile, bench.channels[GREEN].geometry)[height // 2]
    axis.plot(torch.arange(width), half[height // 2], "k:", label="without")
    axis.plot(torch.arange(width), row, label="with")
    axis.set(title=f"stray light, {100 * stage.share:g} %", xlabel="column [px]", ylabel="relative intensity")
    axis.legend(fontsize=8)


def _chart(axes: list[Axes], workbench: CalibratedBench) -> None:
    """A flat phase (zero order and fringes), sensor noise, and a capture of a chart beside its target."""
    spec, bench = workbench.spec, workbench.bench
    flat = torch.zeros(3, *spec.shape)
    with torch.no_grad():
        _picture(
            axes[0], bench.image(flat)[GREEN], "image plane under a flat phase, green", "intensity / incident", "magma"
        )
    levels = torch.linspace(0, 1, 60)
    sensor, draw = bench.profile.sensor, bench.channels[GREEN].geometry.generator("sheet noise")
    patch = torch.ones(40, 40)
    normal = torch.randn(patch.shape, generator=draw)
    noise = [float(sensor.expose(patch * level, sensor.full_well, patch, normal).std()) for level in levels]
    axes[1].plot(levels * sensor.full_well, noise)
    axes[1].set(title="sensor noise", xlabel="signal [electrons]", ylabel="standard deviation [DN]")
    chart = Charts(names=("tv_lines",))
    target = chart.load("tv_lines", spec.region.shape)
    method = Wirtinger(iterations=STEPS)
    phase = method.solve(target[None], workbench.for_method(method, "wirtinger", target, "chart", 0))[0]
    shot = workbench.photograph(phase, target, "chart", 0)
    psnr = score(shot.image, target, metrics=("psnr",))["psnr_linear"]
    for axis, image, title in (
        (axes[2], target, "chart: target"),
        (
            axes[3],
            match(shot.image, target)[0],
            f"chart: capture, {STEPS} steps of Wirtinger holography, {psnr:.1f} dB",
        ),
    ):
        axis.imshow(srgb_encode(torch.as_tensor(image)).permute(1, 2, 0).float().numpy(), interpolation="nearest")
        axis.set(title=title, xlabel="column [px]", ylabel="row [px]")
