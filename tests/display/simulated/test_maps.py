"""Measured maps act as the seeded ones that they are equal to, and a file that is not as it should be is refused."""

import hashlib
import io
import json
import math
import re
import struct
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from torch import Tensor

from holobench_eval.core.errors import UserError
from holobench_eval.display import Profile, load_profile
from holobench_eval.display.simulated.changes import altered, checked
from holobench_eval.display.simulated.maps import KEYS
from holobench_eval.display.simulated.pipeline import SimulatedBench
from holobench_eval.optics.zernike import NAMES

PANEL = (64, 80)
Arrays = dict[str, Any]


@pytest.fixture(scope="module")
def seeded() -> Profile:
    """A display with a blaze and an iris, of which every map and number is drawn or given."""
    profile = load_profile("leto-2020").scaled(PANEL)
    fit = replace(profile.propagation, aberration={"coma_x": 0.05, "defocus": -0.04, "astigmatism_45": 0.03})
    uneven = replace(profile.crosstalk, ratio=1.3)
    slanted = replace(profile.illumination, power=0.8)
    return replace(profile, propagation=fit, crosstalk=uneven, illumination=slanted)


def picture(profile: Profile) -> Tensor:
    """The light of one speckle pattern and one smooth one, ``(2, C, H, W)``."""
    draw = torch.Generator().manual_seed(3)
    rough = torch.rand(3, *PANEL, generator=draw) * math.tau
    smooth = torch.nn.functional.interpolate(rough[None, :, :8, :8] * 3, size=PANEL, mode="bicubic")[0]
    bench = SimulatedBench(profile)
    with torch.no_grad():
        return torch.stack([bench.image(rough), bench.image(smooth)])


def colours(profile: Profile, of: Callable[[Any], Tensor]) -> Tensor:
    return torch.stack([of(maps.geometry) for maps in SimulatedBench(profile).channels]).float()


def table(profile: Profile) -> Profile:
    levels = torch.arange(2.0**profile.panel.bits)
    phases = [profile.lut.phase(levels, profile.panel.bits, torch.ones(()), c) for c in range(3)]
    lut = replace(profile.lut, gamma=(1.0, 1.0, 1.0), maps={"table": torch.stack(phases)})
    return replace(profile, lut=lut)


def gain(profile: Profile) -> Profile:
    over = colours(profile, profile.lut.gain_map) / torch.tensor(profile.lut.gain)[:, None, None]
    return replace(profile, lut=replace(profile.lut, variation=0.0, maps={"gain": over}))


def crosstalk(profile: Profile) -> Profile:
    widths = torch.tensor([profile.crosstalk.widths(c) for c in range(3)])
    return replace(profile, crosstalk=type(profile.crosstalk)(maps={"width": widths}))


def illumination(profile: Profile) -> Profile:
    own = profile.illumination
    maps = {"amplitude": colours(profile, lambda at: own.panel(at).abs()), "phase": colours(profile, own.wavefront)}
    maps["power"] = torch.full((3,), own.power)
    return replace(profile, illumination=type(own)(tilt=own.tilt, maps=maps))


def aberration(profile: Profile) -> Profile:
    radians = torch.zeros(3, len(NAMES))
    for c, wavelength in enumerate(profile.panel.wavelengths):
        for name, waves in profile.propagation.aberration.items():
            radians[c, NAMES[name] - 1] = math.tau * waves * 517e-9 / wavelength
    return replace(profile, propagation=replace(profile.propagation, aberration={}, maps={"aberration": radians}))


def zero_order(profile: Profile) -> Profile:
    modulated, unmodulated = profile.zero_order.amplitudes(0)
    relative = unmodulated / modulated
    still = type(profile.zero_order)(maps={"field": torch.tensor([[relative.real, relative.imag]] * 3)})
    light = replace(profile.illumination, maps={"power": torch.full((3,), modulated**2)})
    return replace(profile, zero_order=still, illumination=light)


def stray_light(profile: Profile) -> Profile:
    own = profile.stray_light
    maps = {"share": torch.full((3,), own.share), "reach": torch.full((3,), own.reach), "blur": torch.zeros(3, 2)}
    return replace(profile, stray_light=type(own)(maps=maps))


@pytest.mark.parametrize("measured", [table, gain, crosstalk, illumination, zero_order, stray_light])
def test_a_map_that_is_equal_to_what_is_drawn_gives_the_same_picture(seeded: Profile, measured) -> None:
    before, after = picture(seeded), picture(measured(seeded))
    assert float((after - before).norm() / before.norm()) < 2e-4


def test_a_measured_aberration_is_the_given_one_within_the_iris_and_none_beyond(seeded: Profile) -> None:
    f = torch.linspace(-0.5, 0.5, 51, dtype=torch.float64) / seeded.panel.pitch
    pupil = seeded.panel.pupil or 1.0
    inside = torch.hypot(f[:, None], f[None]) * 2 * seeded.panel.pitch < pupil
    for maps in SimulatedBench(seeded).channels:
        given, own = (
            each.propagation.pupil_phase(f[:, None], f[None], maps.geometry, pupil)
            for each in (seeded, aberration(seeded))
        )
        assert torch.allclose(own[inside], given[inside], atol=1e-5)
        assert float(given[inside].abs().max()) > 0.5
        assert not own[~inside].any()


def test_a_map_of_one_colour_changes_that_colour_alone_and_is_enlarged_with_corners_on_corners(seeded: Profile) -> None:
    flat = replace(seeded, illumination=type(seeded.illumination)())
    ramp = torch.linspace(0, 2, 5)[None, None, :].expand(3, 5, 5).clone()
    ramp[0] = 1.0
    tilted = replace(flat, illumination=replace(flat.illumination, maps={"amplitude": ramp}))
    assert torch.equal(picture(flat)[:, 0], picture(tilted)[:, 0])
    assert not torch.allclose(picture(flat)[:, 1], picture(tilted)[:, 1], rtol=0.1)
    light = tilted.illumination.panel(SimulatedBench(flat).channels[1].geometry).abs()
    assert torch.allclose(light[7, [0, -1]], torch.tensor([0.0, 2.0]), atol=1e-6)
    assert light[7, 39:41].mean() == pytest.approx(1.0, abs=1e-5)


def test_shading_response_and_ambient_act_in_this_order_at_the_unit_of_a_white_pixel() -> None:
    plain = load_profile("ideal").scaled(PANEL)
    ones = torch.ones(3)
    maps = {"shading": 0.25 * torch.ones(3, 4, 4), "exponent": 0.5 * ones, "ambient": 0.1 * ones}
    shaded = replace(plain, sensor=replace(plain.sensor, noise=False, maps=maps))
    before, after = picture(plain), picture(shaded)
    assert torch.allclose(after, before / 4, rtol=1e-4)
    sensor, light, response = shaded.sensor, torch.full((4, 4), 0.16), torch.ones(4, 4)
    mean, _ = sensor.expected(light, response, channel=2)
    assert torch.allclose(mean, torch.full((4, 4), 0.4 + 0.1))
    electrons = 700.0  # of a unit of light
    white = sensor.full_well / sensor.headroom
    counted = sensor.expose(light * white / electrons, electrons, response, torch.zeros(4, 4), channel=2)
    assert torch.allclose((counted - sensor.dark) / sensor.counts_per_electron / white, mean)


def test_blur_keeps_flat_light_and_spreads_a_point_by_its_widths() -> None:
    plain = load_profile("ideal").scaled(PANEL)
    blur = replace(plain.stray_light, maps={"blur": torch.tensor([[0.5, 2.0]] * 3)})
    geometry = SimulatedBench(plain).channels[0].geometry
    assert torch.allclose(blur.image(torch.ones(PANEL), plain, geometry), torch.ones(PANEL), atol=1e-6)
    point = torch.zeros(PANEL)
    point[32, 40] = 1.0
    spread = blur.image(point, plain, geometry)
    offsets = torch.arange(80.0) - 40
    assert float((spread.sum(0) * offsets**2).sum()) == pytest.approx(4.0, rel=1e-3)
    assert float(spread.sum()) == pytest.approx(1.0, rel=1e-3)


def arrays() -> Arrays:
    """One of each, small."""
    sizes = {"colours": 3, "levels": 256, "rows": 5, "columns": 6, "modes": len(NAMES), "2": 2}
    return {
        key: np.full([sizes[axis] for axis in each.axes], min(1.0, each.high) / 2, np.float32)
        for key, each in KEYS.items()
    }


def packed(given: Mapping[str, Any]) -> bytes:
    content = io.BytesIO()
    np.savez_compressed(content, **given)
    return content.getvalue()


def written(folder: Path, content: bytes, more: str = "", **said: Any) -> Path:
    """A profile with a file of maps; said: what it says of the file, instead of the truth."""
    panel = {**asdict(load_profile("ideal").scaled(PANEL).panel)}
    panel.pop("maps")
    about = {"file": "lab.npz", "size": len(content), "sha256": hashlib.sha256(content).hexdigest(), **said}
    head = "name: lab\nversion: 1\nseed: 0\ndescription: A display.\nsampling: 3\n"
    (folder / "lab.yaml").write_text(f"{head}panel: {json.dumps(panel)}\nmaps: {json.dumps(about)}\n{more}")
    (folder / "lab.npz").write_bytes(content)
    return folder / "lab.yaml"


def test_a_profile_reads_its_maps_and_says_what_they_hold(tmp_path: Path) -> None:
    path = written(tmp_path, packed(arrays()))
    profile = load_profile("lab.yaml", tmp_path)
    assert profile.held == list(KEYS)
    names = [effect.name for effect in profile.effects()]
    assert len(names) == len(set(names))
    assert {"look_up_table", "gain_map", "crosstalk", "beam", "wavefront", "zero_order", "coma_x"} <= set(names)
    assert {"blur", "stray_light", "shading", "response", "offset"} <= set(names)
    assert bool(picture(profile).isfinite().all())
    digest = profile.digest
    other = arrays() | {"lut.gain": np.ones((3, 5, 6), np.float32)}
    written(tmp_path, packed(other))
    assert load_profile(str(path)).digest != digest
    (tmp_path / "far.yaml").write_text("like: below/lab.yaml\nname: far\n")  # the maps of a base lie beside it
    (tmp_path / "below").mkdir()
    written(tmp_path / "below", packed(other))
    assert load_profile("far.yaml", tmp_path).held == list(KEYS)


def test_a_profile_with_maps_has_one_panel(tmp_path: Path) -> None:
    profile = load_profile(str(written(tmp_path, packed(arrays()))))
    assert profile.scaled(PANEL) is profile
    assert profile.usual == PANEL
    for other in ([64, 70], [500, 500]):
        message = f"^'lab' has maps of its panel of 64 x 80 pixels; give that panel, not {re.escape(str(other))}$"
        with pytest.raises(UserError, match=message):
            profile.scaled((other[0], other[1]))


def test_changes_act_on_top_of_maps_or_are_refused(tmp_path: Path) -> None:
    profile = load_profile(str(written(tmp_path, packed(arrays()))))
    for kind in ("draw", "sibling"):
        with pytest.raises(UserError, match=f"^{kind} does not suit 'lab': "):
            altered(profile, kind, checked(kind, "3"))
    with pytest.raises(UserError, match=r"^bits does not suit 'lab': the map lut.table has 256 levels, not 16$"):
        altered(profile, "bits", 4.0)
    geometry = SimulatedBench(profile).channels[0].geometry
    warm = altered(profile, "temperature", 20.0)
    gains = [float(one.lut.gain_map(geometry).mean()) for one in (profile, warm)]
    assert gains[1] / gains[0] == pytest.approx(warm.lut.gain[0])
    assert altered(profile, "ambient", 0.2).sensor.surrounding(1) == pytest.approx(0.7)
    assert altered(profile, "laser_power", 0.5).illumination.laser(0) == pytest.approx(0.25)
    assert set(altered(profile, "sensor", "fujifilm-s5-pro").sensor.maps) == {"shading", "ambient"}
    drifting = replace(profile, drift=replace(profile.drift, power=0.1, tilt=0.5, gain=0.01, days=9.0))
    assert not torch.allclose(picture(drifting), picture(profile), rtol=0.01)


def unlike(**given: Any) -> bytes:
    return packed({**arrays(), **{key.replace("__", "."): value for key, value in given.items()}})


def promising(shape: str, way: int = zipfile.ZIP_STORED) -> bytes:
    """An array whose header promises more than there is."""
    header = f"{{'descr': '<f4', 'fortran_order': False, 'shape': {shape}}}\n".encode()
    array = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header + bytes(12)
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", way) as archive:
        archive.writestr("sensor.ambient.npy", array)
    return content.getvalue()


FLAT = np.ones((3, 5, 6), np.float32)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (packed(arrays())[:-300], "no npz file of plain arrays"),
        (b"not a zip file", "no npz file of plain arrays"),
        (unlike(lut__gain=np.array([{}, None])), "is of the type .* expected float32"),
        (unlike(lut__gain=FLAT.astype(float)), "'lut.gain' is of the type '<f8'; expected float32"),
        (unlike(lut__gain=FLAT * np.float32(np.nan)), "'lut.gain' has values that are not finite or below 0"),
        (unlike(lut__gain=-FLAT), "not finite or below 0"),
        (unlike(lut__gain=20 * FLAT), "'lut.gain' has values above 10"),
        (unlike(lut__gain=FLAT[:2]), r"'lut.gain' has the shape \(2, 5, 6\); expected .*, here \(3, 64, 80\), or with"),
        (unlike(lut__gain=np.ones((3, 65, 80), np.float32)), r"has the shape \(3, 65, 80\)"),
        (unlike(lut__table=np.ones((3, 16), np.float32)), r"'lut.table' has the shape \(3, 16\).*here \(3, 256\)"),
        (unlike(crosstalk__width=np.ones(3, np.float32)), r"expected \(colours, 2\), here \(3, 2\)"),
        (unlike(lut__gian=FLAT), "no display has a map 'lut.gian'; did you mean 'lut.gain'"),
        (unlike(lut__gain=np.zeros((3, 1500, 1500), np.float32)), "its arrays are larger than 20 MB in all"),
        (promising("(3, 99999999999)"), "no npz file of plain arrays"),
        (promising("(3,)", zipfile.ZIP_LZMA), r"no npz file .*compressed in another way"),
        (promising("(3,)").replace(b"(3,)", b"(4,)"), "no npz file of plain arrays"),
        (promising("(" * 200), "no npz file of plain arrays"),
    ],
)
def test_a_file_that_is_no_file_of_maps_is_one_line(tmp_path: Path, content: bytes, message: str) -> None:
    written(tmp_path, content)
    with pytest.raises(UserError, match=rf"^\S*lab.yaml:7:16: .*{message}") as told:
        load_profile("lab.yaml", tmp_path)
    assert "\n" not in str(told.value)


@pytest.mark.parametrize(
    ("said", "more", "message"),
    [
        ({"size": 7}, "", r"lab.npz has \d+ bytes, and the profile says 7: another file, or damaged$"),
        ({"sha256": "0" * 64}, "", "lab.npz has another SHA-256 than the profile says"),
        ({"size": 20_000_001}, "", "maps.size should be less than or equal to 20000000"),
        ({"file": "none.npz"}, "", "no such file: .*none.npz$"),
        ({"file": "../lab.npz"}, "", "'../lab.npz' is not a file in the profile's folder"),
        ({"file": "/etc/passwd"}, "", "'/etc/passwd' is not a file in the profile's folder"),
        ({"file": "link.npz"}, "", "'link.npz' is a link that leaves the profile's folder"),
        ({"file": "circle.npz"}, "", "'circle.npz' is a link that leaves the profile's folder"),
        ({}, "lut: {gamma: [1.2, 1, 1]}\n", "lab.yaml:8:14: lut.gamma has no effect beside the map lut.table$"),
        ({}, "zero_order: {fraction: 0.1}\n", "zero_order.fraction has no effect beside the map zero_order.field$"),
    ],
)
def test_a_file_that_is_elsewhere_or_another_one_is_one_line(tmp_path, said, more: str, message: str) -> None:
    folder = tmp_path / "profile"
    folder.mkdir()
    (tmp_path / "lab.npz").write_bytes(packed(arrays()))
    (folder / "link.npz").symlink_to(tmp_path / "lab.npz")
    (folder / "circle.npz").symlink_to("circle.npz")
    written(folder, packed(arrays()), more=more, **said)
    with pytest.raises(UserError, match=message) as told:
        load_profile("lab.yaml", folder)
    assert "\n" not in str(told.value)
