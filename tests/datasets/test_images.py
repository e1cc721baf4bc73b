import hashlib
import importlib.resources
import io
import itertools
from collections import Counter

import cv2
import numpy as np
import pytest
import skimage
import torch
from matplotlib import cbook
from PIL import Image, ImageOps

from holobench_eval.core.errors import UserError
from holobench_eval.datasets import crops, images, renderings, shipped
from holobench_eval.datasets.base import clusters_of, from_srgb, named_digest
from holobench_eval.datasets.crops import FLAT, NAMES, Crops
from holobench_eval.datasets.images import decode, read
from holobench_eval.datasets.photographs import NAMES as PHOTOGRAPHS
from holobench_eval.datasets.photographs import Photographs
from holobench_eval.datasets.renderings import CONTRAST, MEAN, SCENES, exposed, rendering
from holobench_eval.datasets.seeded import Seeded
from holobench_eval.datasets.still_life import still_life
from holobench_eval.display import load_profile
from holobench_eval.optics import srgb_decode

PIXELS = np.random.default_rng(5).integers(0, 256, (12, 20, 3), dtype=np.uint8)
DEEP = np.random.default_rng(6).integers(0, 65536, (12, 20, 3), dtype=np.uint16)


def encoded(image: Image.Image, kind: str = "PNG", **options: object) -> bytes:
    file = io.BytesIO()
    image.save(file, kind, **options)
    return file.getvalue()


def deep(pixels: np.ndarray, suffix: str = ".png") -> bytes:
    return cv2.imencode(suffix, pixels[..., ::-1] if pixels.ndim == 3 else pixels)[1].tobytes()


def linear(pixels: np.ndarray) -> torch.Tensor:
    return srgb_decode(torch.from_numpy(pixels.astype(np.float64)) / np.iinfo(pixels.dtype).max).float()


def refusal(content: bytes, **options) -> str:
    with pytest.raises(UserError) as caught:
        decode(content, "folder/x.png", **options)
    line = str(caught.value)
    assert line.startswith("folder/x.png: ")
    assert "expected" in line
    assert "\n" not in line
    return line


RGB = Image.fromarray(PIXELS)


@pytest.mark.parametrize("kind", ["PNG", "BMP"])
def test_eight_bit_rgb_is_decoded_to_linear_light(kind):
    found = decode(encoded(RGB, kind), "x")
    assert torch.allclose(found, linear(PIXELS).permute(2, 0, 1), atol=1e-6)


KINDS = {
    "one channel": (encoded(RGB.convert("L")), "one-channel"),
    "alpha": (encoded(Image.merge("RGBA", [*RGB.split(), RGB.getchannel(0)])), "alpha that is not opaque"),
    "palette": (encoded(RGB.convert("P")), "palette"),
    "one bit": (encoded(RGB.convert("1")), "1-bit"),
    "CMYK": (encoded(RGB.convert("CMYK"), "JPEG"), "CMYK"),
    "floating point": (encoded(RGB.convert("F"), "TIFF"), "floating-point"),
    "transparent colour": (encoded(RGB, transparency=(0, 0, 0)), "transparent colour"),
    "16-bit": (deep(DEEP), "16-bit"),
    "two frames": (encoded(RGB, save_all=True, append_images=[ImageOps.mirror(RGB)]), "2 frames"),
    "PostScript": (b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 9 9\n%%EndComments\n", "not an image"),
}


@pytest.mark.parametrize("kind", list(KINDS))
def test_every_other_kind_is_refused_by_its_name(kind):
    content, word = KINDS[kind]
    assert word in refusal(content)


def test_gray_is_replicated_when_it_is_asked_for():
    gray = PIXELS[..., 0]
    found = decode(encoded(Image.fromarray(gray)), "x", gray=True)
    assert torch.allclose(found, linear(gray).expand(3, -1, -1), atol=1e-6)
    assert torch.equal(decode(encoded(Image.fromarray(gray).convert("LA")), "x", gray=True), found)
    assert "not opaque" in refusal(encoded(Image.merge("LA", RGB.split()[:2])), gray=True)
    assert "1-bit" in refusal(encoded(RGB.convert("1")), gray=True)


@pytest.mark.parametrize("suffix", [".png", ".tiff"])
def test_16_bit_levels_keep_their_precision_as_srgb_or_as_linear_light(suffix):
    content = deep(DEEP, suffix)
    as_srgb, as_linear = decode(content, "x", sixteen_bit="srgb"), decode(content, "x", sixteen_bit="linear")
    assert torch.allclose(as_srgb, linear(DEEP).permute(2, 0, 1), atol=1e-6)
    assert torch.allclose(as_linear, torch.from_numpy(DEEP / 65535).float().permute(2, 0, 1), atol=1e-7)


def test_16_bit_gray_needs_both_choices():
    exif = Image.Exif()
    exif[274] = 6  # stored on its side
    content = encoded(Image.fromarray(DEEP[..., 0]), "TIFF", exif=exif)
    assert "one-channel" in refusal(content, sixteen_bit="linear")
    assert "16-bit" in refusal(content, gray=True)
    found = decode(content, "x", gray=True, sixteen_bit="linear")
    wanted = torch.from_numpy(np.rot90(DEEP[..., 0], 3) / 65535).float().expand(3, -1, -1)
    assert torch.allclose(found, wanted, atol=1e-7)


def test_reading_refuses_what_is_no_file(tmp_path, monkeypatch):
    with pytest.raises(UserError, match="no such file"):
        read(tmp_path / "missing.png")
    with pytest.raises(UserError, match="not a regular file"):
        read(tmp_path)
    monkeypatch.setattr(images, "LARGEST_BYTES", 10)
    (tmp_path / "large.png").write_bytes(bytes(11))
    with pytest.raises(UserError, match="larger than"):
        read(tmp_path / "large.png")


def test_count_takes_the_first_six_in_colour_before_the_gray_ones_and_names_keep_their_order():
    eight = ["astronaut", "coffee", "chelsea", "rocket", "hubble_deep_field", "retina", "camera", "brick"]
    assert Photographs().items() == eight
    assert Photographs(count=None).items() == [*eight, "grass", "gravel", "text"]
    assert Photographs(count=2).items() == eight[:2]
    assert Photographs(names=("text", "astronaut")).items() == ["text", "astronaut"]


@pytest.mark.parametrize("name", ["coffee", "camera"])
def test_pixels_are_those_of_skimage_in_linear_light(name):
    pixels = getattr(skimage.data, name)()
    linear = srgb_decode(torch.from_numpy(pixels / 255.0)).float()
    wanted = linear.permute(2, 0, 1) if linear.ndim == 3 else linear.expand(3, *linear.shape)
    assert torch.allclose(Photographs().load(name, pixels.shape[:2]), wanted, atol=1e-6)


def test_the_digest_is_that_of_the_file_in_the_package_and_one_that_is_missing_is_one_line(monkeypatch):
    file = importlib.resources.files("skimage").joinpath("data", "astronaut.png")
    assert Photographs().digest("astronaut") == hashlib.sha256(file.read_bytes()).hexdigest()
    monkeypatch.setitem(shipped.FILES, "brick", ("no-such-file.png", shipped.SKIMAGE))
    shipped.content_digest.cache_clear()
    with pytest.raises(UserError, match="'brick' is not in the installed scikit-image"):
        Photographs().digest("brick")


def test_every_file_ships_with_scikit_image_and_nothing_asks_for_a_download(monkeypatch):
    def refuse(*names: object) -> None:
        raise AssertionError(f"asked scikit-image to fetch {names}")

    monkeypatch.setattr("skimage.data._fetchers._fetch", refuse)
    shipped.decoded.cache_clear()
    shipped.content_digest.cache_clear()
    dataset = Photographs(count=None)
    assert len({dataset.digest(item) for item in dataset.items()}) == len(PHOTOGRAPHS)
    assert np.isfinite(dataset.load("grass", (16, 16)).numpy()).all()


GOLDEN = {"landscape-1": 0.32954, "street-1": 0.21124, "table-1": 0.15880, "stones-1": 0.33545}
"""Light of version 1 at 60 x 80 px under a ramp of weights, which no shifted or mirrored picture shares."""

SIDE = 104


def spectral_slope(picture: torch.Tensor) -> float:
    """The a of an amplitude spectrum f^-a, from 4 cycles a picture to a quarter of its pixels."""
    side = picture.shape[-1]
    window = np.outer(np.hanning(side), np.hanning(side))
    gray = picture.mean(0).double().numpy()
    power = np.abs(np.fft.fft2((gray - gray.mean()) * window)) ** 2
    frequency = np.hypot(*np.meshgrid(np.fft.fftfreq(side, 1 / side), np.fft.fftfreq(side, 1 / side)))
    edges = np.geomspace(4, side / 4, 9)
    rings = [(frequency >= low) & (frequency < high) for low, high in itertools.pairwise(edges)]
    return -np.polyfit(np.log(edges[:-1]), np.log([power[ring].mean() for ring in rings]), 1)[0] / 2


def test_the_drawings_are_those_of_this_version():
    """A drawing that changes fails here: raise VERSION with it, so that old records are not taken for new ones."""
    assert renderings.VERSION == 1
    ramp = torch.linspace(0.0, 1.0, 60)[:, None] * torch.linspace(1.0, 2.0, 80)
    weights = ramp * torch.tensor([1.0, 2, 3])[:, None, None]
    found = {name: float((rendering(name, (60, 80)) * weights).mean()) for name in GOLDEN}
    assert found == pytest.approx(GOLDEN, rel=2e-3)


@pytest.fixture(scope="module")
def photographs() -> list[float]:
    return [spectral_slope(Crops(renderings=0).load(item, (SIDE, SIDE))) for item in Crops(renderings=0).items()]


@pytest.mark.parametrize("kind", SCENES)
def test_a_scene_has_light_contrast_and_colour_as_drawn_for_it_and_the_spectrum_of_photographs(kind, photographs):
    pictures = torch.stack([rendering(f"{kind}-{number}", (SIDE, SIDE)) for number in range(1, 5)])
    means = pictures.mean((1, 2, 3))
    assert MEAN[0] * 0.98 <= float(means.min()) < float(means.max()) <= MEAN[1] * 1.02
    shares = pictures.mean(1).std((1, 2)) / means
    assert CONTRAST[0] * 0.9 <= float(shares.min()) < float(shares.max()) <= CONTRAST[1] * 1.1
    assert float((pictures.amax(1) - pictures.amin(1)).mean()) > 0.02
    slopes = [spectral_slope(picture) for picture in pictures]
    assert abs(np.mean(slopes) - np.mean(photographs)) < 2 * np.std(photographs)


@pytest.mark.parametrize("kind", SCENES)
def test_the_last_bits_of_numbers_do_not_decide_what_is_drawn(kind):
    across, down = np.meshgrid(*[(np.arange(48) + 0.5 - 24) / 48] * 2)
    shaken = 1 + 1e-13 * (2 * np.random.default_rng(0).random((2, 48, 48)) - 1)
    one = SCENES[kind](Seeded("bits"), across, -down)
    other = SCENES[kind](Seeded("bits"), across * shaken[0], -down * shaken[1])
    assert np.abs(one - other).max() < 1e-6 * one.max()


def test_every_name_is_another_picture_and_exposure_gives_the_mean_and_deviation_asked_for():
    pictures = [rendering(f"{kind}-{number}", (32, 32)) for kind in SCENES for number in (1, 2)]
    different = [float((a - b).abs().mean()) for i, a in enumerate(pictures) for b in pictures[:i]]
    assert min(different) > 0.02
    radiance = torch.rand(3, 60, 60, generator=torch.Generator().manual_seed(1)) ** 3
    picture = exposed(100 * radiance, 0.25, 0.2)
    assert float(picture.mean()) == pytest.approx(0.25, abs=0.005)
    assert torch.equal(picture.argmax(0), radiance.argmax(0))


def test_the_default_is_40_targets_in_40_clusters_for_a_panel_of_256():
    dataset = Crops()
    assert load_profile("leto-aged").spec((256, 256)).region.shape == (dataset.size, dataset.size)
    assert len(dataset.items()) == 40
    assert len(set(clusters_of(dataset).values())) == 40
    kinds = Counter(item.rsplit("-", 1)[0] for item in dataset.items()[14:])
    assert kinds == {"landscape": 7, "street": 7, "table": 6, "stones": 6}


def test_what_the_default_scores_does_not_change_unnoticed():
    """A change here needs a new VERSION of the dataset, since committed studies score these crops."""
    places = Crops(each=2)._places()
    assert places["astronaut-1"] == ("astronaut", 48, 48)
    chosen = {name: [int(item[-1]) for item in places if places[item].photograph == name] for name in NAMES}
    assert {name: numbers for name, numbers in chosen.items() if numbers != [1, 2]} == {
        "rocket": [4, 5],
        "hubble_deep_field": [6, 7],
        "motorcycle": [2, 5],
        "coins": [1],
        "moon": [1],
    }


def test_a_crop_has_the_pixels_of_its_photograph_and_a_smaller_region_shows_its_middle():
    with Image.open(cbook.get_sample_data("grace_hopper.jpg", asfileobj=False)) as image:
        picture = from_srgb(np.asarray(image))
    top, left = (600 - 2 * 208) // 2, (512 - 2 * 208) // 2
    wanted = picture[:, top : top + 208, left + 208 : left + 416]
    assert torch.equal(Crops(each=2).load("grace_hopper-2", (208, 208)), wanted)
    assert torch.equal(Crops(each=2).load("grace_hopper-2", (169, 100)), wanted[:, 19:188, 54:154])


def test_crops_of_a_photograph_are_disjoint_and_inside_it_and_a_larger_region_is_one_line():
    for name in NAMES:
        height, width = shipped.decoded(name).shape[1:]
        places = [crop for _, crop in crops._best(name, 208, 100)]
        assert all(0 <= top <= height - 208 and 0 <= left <= width - 208 for _, top, left in places)
        for one, other in itertools.combinations(places, 2):
            assert max(abs(one.top - other.top), abs(one.left - other.left)) >= 208
    with pytest.raises(UserError, match="208 x 208 pixels has no room for a target of 877 x 1560"):
        Crops().load("coins-1", (877, 1560))


def test_the_middle_of_a_photograph_comes_first_and_flat_crops_are_left_out():
    assert Crops(names=("moon",), each=4, renderings=0).items() == ["moon-1"]  # of four squares
    for place in ((48, 256), (256, 48), (256, 256)):
        assert crops._contrast(crops._cut(crops.Crop("moon", *place), (208, 208))) < FLAT
    assert Crops(names=("hubble_deep_field",), each=1).items()[0] == "hubble_deep_field-6"  # of four by four
    assert Crops(names=("motorcycle",), each=1).items()[0] == "motorcycle-2"  # of two rows of three


def test_renderings_are_drawn_in_the_shape_asked_for_and_two_are_the_still_lifes_of_earlier_studies():
    dataset = Crops(names=("coins",), renderings=3)
    assert dataset.items() == ["coins-1", "landscape-1", "street-1", "table-1"]
    assert dataset.load("landscape-1", (100, 210)).shape == (3, 100, 210)
    assert [dataset.cluster(item) for item in dataset.items()] == ["coins", *dataset.items()[1:]]
    dataset = Crops(names=("coins",), renderings=2)
    assert dataset.items() == ["coins-1", "still-life-1", "still-life-2"]
    assert [dataset.cluster(item) for item in dataset.items()] == ["coins", "still-life", "still-life"]
    assert len(set(clusters_of(Crops(each=2, renderings=2)).values())) == 15
    assert dataset.digest("still-life-1") == named_digest("still-life-1", 1)
    drawn = torch.from_numpy(still_life("still-life-1", (40, 40))[0]).float()
    assert torch.equal(dataset.load("still-life-1", (40, 40)).permute(1, 2, 0), drawn)
