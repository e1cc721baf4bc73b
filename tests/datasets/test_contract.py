"""What every dataset must do: those with an entry point, and one that somebody keeps in a file of their own."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from holobench_eval.core import plugins
from holobench_eval.core.errors import UserError
from holobench_eval.datasets.base import clusters_of, digest_of, fit, from_srgb, with_channels
from holobench_eval.optics import srgb_decode

STRANGER = """
from dataclasses import dataclass
from hashlib import sha256
from typing import Annotated, ClassVar

import torch
from annotated_types import Interval
from holobench_eval.core.seeds import generator
from holobench_eval.datasets.base import known, with_channels


@dataclass(frozen=True)
class Noise:
    count: Annotated[int, Interval(ge=1)] = 2
    training: ClassVar[bool] = False

    def items(self):
        return [f"noise-{index}" for index in range(self.count)]

    def load(self, item, shape, channels=3):
        draw = generator("noise", known("noise", item, self.items()))
        return with_channels(torch.rand(3, *shape, generator=draw), channels)

    def digest(self, item):
        return sha256(known("noise", item, self.items()).encode()).hexdigest()
"""


@pytest.fixture(params=[*plugins.names("datasets"), "noise.py:Noise"])
def dataset(request, tmp_path) -> Any:
    params: dict[str, Any] = {}
    (tmp_path / "noise.py").write_text(STRANGER)
    if request.param == "folder":
        draw = np.random.default_rng(0)
        for name in ("b.png", "a.png"):
            Image.fromarray(draw.integers(0, 256, (30, 50, 3), dtype=np.uint8)).save(tmp_path / name)
        params = {"path": str(tmp_path)}
    return plugins.build("datasets", request.param, params, tmp_path)


def test_parameters_of_a_dataset_in_a_file_are_checked_as_those_of_any_other(tmp_path):
    (tmp_path / "noise.py").write_text(STRANGER)
    assert plugins.build("datasets", "noise.py:Noise", {"count": 3}, tmp_path).items()[-1] == "noise-2"
    for params, line in (
        ({"cuont": 3}, "no parameter 'cuont'; did you mean 'count'"),
        ({"count": 0}, "'count': input"),
    ):
        with pytest.raises(UserError, match=line):
            plugins.build("datasets", "noise.py:Noise", params, tmp_path)


@pytest.mark.parametrize("shape", [(48, 64), (64, 48), (40, 40)])
@pytest.mark.parametrize("channels", [3, 1])
def test_a_target_is_float32_of_the_shape_asked_for_in_0_to_1(dataset, shape, channels):
    for item in dataset.items()[:3]:
        target = dataset.load(item, shape, channels=channels)
        assert target.shape == (channels, *shape)
        assert target.dtype == torch.float32
        assert 0.0 <= float(target.min()) < float(target.max()) <= 1.0


def test_loading_twice_gives_the_same_numbers_in_memory_of_its_own(dataset):
    item = dataset.items()[0]
    first = dataset.load(item, (40, 56))
    second = dataset.load(item, (40, 56))
    assert torch.equal(first, second)
    first.zero_()
    assert torch.equal(second, dataset.load(item, (40, 56)))


def test_one_channel_is_the_luminance_of_three_and_two_are_refused(dataset):
    item = dataset.items()[0]
    colour = dataset.load(item, (40, 56))
    weighted = 0.2126 * colour[0] + 0.7152 * colour[1] + 0.0722 * colour[2]
    assert torch.allclose(dataset.load(item, (40, 56), channels=1)[0], weighted, atol=1e-6)
    with pytest.raises(UserError, match="3 channels"):
        dataset.load(item, (40, 56), channels=2)


def test_a_dataset_without_a_digest_is_told_by_its_pixels():
    @dataclass(frozen=True)
    class Bare:
        corner: float = 0.5

        def load(self, item, shape, channels=3):
            wide = torch.full((channels, 300, 400), len(item) / 10)
            wide[:, :, :20] = self.corner
            return fit(wide, shape)

    assert len({digest_of(Bare(), "a"), digest_of(Bare(), "bb"), digest_of(Bare(0.6), "a")}) == 3
    assert digest_of(Bare(), "a") == digest_of(Bare(), "a")
    with pytest.raises(UserError, match=r"dataset 'Bare', image '5': TypeError: object of type 'int' has no len"):
        digest_of(Bare(), 5)


def test_items_are_unique_and_in_a_fixed_order_and_their_digests_are_sha256(dataset):
    items = dataset.items()
    assert items == dataset.items()
    digests = [dataset.digest(item) for item in items]
    assert all(len(digest) == 64 and set(digest) <= set("0123456789abcdef") for digest in digests)
    assert len(set(digests)) == len(set(items)) == len(items) > 0
    assert digests == [dataset.digest(item) for item in dataset.items()]


def test_an_unknown_item_is_one_line(dataset):
    for act in (lambda: dataset.load("nothing", (40, 40)), lambda: dataset.digest("nothing")):
        with pytest.raises(UserError) as caught:
            act()
        assert "nothing" in str(caught.value)
        assert "\n" not in str(caught.value)


def test_every_item_has_a_cluster_where_any_has(dataset):
    cluster = getattr(dataset, "cluster", None)
    names = {item: cluster(item) for item in dataset.items()} if cluster else {}
    assert all(isinstance(name, str) and name.strip() for name in names.values())  # also None would make a text
    assert clusters_of(dataset) == names


@pytest.mark.parametrize(
    ("name", "params", "message"),
    [
        ("charts", {"names": ["tv_line"]}, "unknown chart 'tv_line'; did you mean 'tv_lines'"),
        ("charts", {"names": []}, "the list of charts is empty"),
        ("charts", {"names": ["tv_lines", "tv_lines"]}, "'tv_lines' is given twice"),
        ("photographs", {"names": ["astronut"]}, "unknown photograph 'astronut'; did you mean 'astronaut'"),
        ("photographs", {"names": []}, "the list of photographs is empty"),
        ("photographs", {"names": ["brick", "brick"]}, "'brick' is given twice"),
        ("photographs", {"count": 0}, "'count'"),
        ("photographs", {"count": 12}, "'count'"),
        ("crops", {"names": ["coin"]}, "unknown photograph 'coin'; did you mean 'coins'"),
        ("crops", {"names": ["coins"], "size": 320}, "has 303 x 384 pixels and no crop of 320 x 320 with a contrast"),
        ("crops", {"each": 0}, "'each'"),
        ("folder", {}, "'path'"),
        ("folder", {"path": ""}, "'path'"),
        ("folder", {"path": "x", "count": 0}, "'count'"),
        ("folder", {"path": "x", "sixteen_bit": "yes"}, "'sixteen_bit'"),
        ("focal_stacks", {"planes": [0.0, 0.0]}, "plane '0.0' is given twice"),
        ("focal_stacks", {"scenes": ["shapes", "shapes"]}, "scene 'shapes' is given twice"),
        ("focal_stacks", {"near": -2.0}, "near is to be larger than far"),
        ("focal_stacks", {"scenes": ["shape"]}, "unknown scene 'shape'; did you mean 'shapes'?"),
    ],
)
def test_wrong_parameters_are_one_line(name, params, message):
    with pytest.raises(UserError) as caught:
        plugins.build("datasets", name, params).items()
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_only_generated_images_are_for_training():
    training = {name: plugins.find("datasets", name).training for name in plugins.names("datasets")}
    assert training["dead_leaves"]
    scored = ("photographs", "crops", "charts", "folder", "focal_stacks", "light_fields")
    assert not any(training[name] for name in scored)


SIDES = st.integers(1, 40)


def disc(shape: tuple[int, int], radius: float) -> torch.Tensor:
    y = torch.arange(shape[0])[:, None] - (shape[0] - 1) / 2
    x = torch.arange(shape[1])[None, :] - (shape[1] - 1) / 2
    return (torch.hypot(y, x) < radius).float()[None]


def spread(image: torch.Tensor) -> tuple[float, float]:
    """Standard deviation of the light in rows and in columns [px]."""
    weight = image[0].double()
    found = []
    for axis in (0, 1):
        profile = weight.sum(1 - axis)
        place = torch.arange(len(profile), dtype=torch.float64)
        mean = (profile * place).sum() / profile.sum()
        found.append(float(((profile * (place - mean) ** 2).sum() / profile.sum()).sqrt()))
    return found[0], found[1]


@pytest.mark.parametrize("source", [(200, 400), (401, 203), (90, 120)])
@pytest.mark.parametrize("shape", [(80, 150), (61, 97)])
def test_a_circle_stays_a_circle_of_the_size_the_crop_implies(source, shape):
    radius = 0.2 * min(source)
    rows, columns = spread(fit(disc(source, radius), shape))
    scale = min(source[0] / shape[0], source[1] / shape[1])
    assert rows == pytest.approx(columns, rel=0.02)
    assert rows == pytest.approx(radius / scale / 2, rel=0.05)


def test_the_crop_is_centred_and_a_small_image_is_enlarged_without_new_extremes():
    columns = torch.linspace(0, 1, 200).expand(1, 100, 200)
    cropped = fit(columns, (100, 100))
    assert torch.allclose(cropped, columns[..., 50:150], atol=1e-6)
    assert torch.equal(fit(cropped, (100, 100)), cropped)  # it has the right size already
    image = torch.rand(3, 8, 8, generator=torch.Generator().manual_seed(2))
    large = fit(image, (50, 50))
    assert large.shape == (3, 50, 50)
    assert float(large.max()) <= float(image.max()) + 1e-6
    assert float(large.min()) >= float(image.min()) - 1e-6


def test_fine_stripes_average_in_linear_light():
    """Black and white lines of one pixel reflect half the light; averaged in sRGB they would give 0.21."""
    stripes = np.zeros((128, 128, 3), np.uint8)
    stripes[:, ::2] = 255
    small = fit(from_srgb(stripes), (16, 16))
    assert torch.allclose(small, torch.full_like(small, 0.5), atol=0.03)


@given(source=st.tuples(SIDES, SIDES), shape=st.tuples(SIDES, SIDES))
def test_any_source_fits_any_shape_and_flat_light_stays_flat(source, shape):
    flat = fit(torch.full((3, *source), 0.3), shape)
    assert flat.shape == (3, *shape)
    assert torch.allclose(flat, torch.full_like(flat, 0.3), atol=1e-6)


def test_levels_are_decoded_as_srgb_and_luminance_of_white_is_one():
    levels = np.arange(256, dtype=np.uint8)[None]
    expected = srgb_decode(torch.arange(256) / 255)
    assert torch.allclose(from_srgb(levels), expected.expand(3, 1, 256), atol=1e-6)
    deep = np.array([[0, 65535, 32768]], dtype=np.uint16)
    assert torch.allclose(from_srgb(deep)[0], srgb_decode(torch.tensor([[0, 1, 32768 / 65535]])), atol=1e-6)
    assert float(with_channels(torch.ones(3, 2, 2), 1).max()) == pytest.approx(1.0)
    with pytest.raises(UserError, match="not 4"):
        with_channels(torch.ones(3, 2, 2), 4)


@pytest.mark.parametrize("colour", range(3))
def test_a_picture_with_light_in_one_colour_is_on_one_laser_what_it_is_in_gray(colour):
    light = torch.rand(8, 9, generator=torch.Generator().manual_seed(3))
    picture = torch.zeros(3, 8, 9)
    picture[colour] = light
    assert torch.equal(with_channels(picture, 1), light[None])
    assert torch.allclose(with_channels(light.expand(3, -1, -1), 1), light[None])
