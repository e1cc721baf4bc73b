"""The photographs inside scikit-image."""

import hashlib
import importlib.resources

import numpy as np
import pytest
import skimage
import torch

from holobench_eval.core.errors import UserError
from holobench_eval.datasets import shipped
from holobench_eval.datasets.photographs import NAMES, Photographs
from holobench_eval.optics import srgb_decode


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


def test_the_digest_is_that_of_the_file_in_the_package():
    file = importlib.resources.files("skimage").joinpath("data", "astronaut.png")
    assert Photographs().digest("astronaut") == hashlib.sha256(file.read_bytes()).hexdigest()


def test_every_file_ships_with_scikit_image_and_nothing_asks_for_a_download(monkeypatch):
    def refuse(*names: object) -> None:
        raise AssertionError(f"asked scikit-image to fetch {names}")

    monkeypatch.setattr("skimage.data._fetchers._fetch", refuse)
    shipped.decoded.cache_clear()
    shipped.content_digest.cache_clear()
    dataset = Photographs(count=None)
    assert len({dataset.digest(item) for item in dataset.items()}) == len(NAMES)
    assert np.isfinite(dataset.load("grass", (16, 16)).numpy()).all()


def test_a_file_missing_from_scikit_image_is_one_line(monkeypatch):
    monkeypatch.setitem(shipped.FILES, "brick", ("no-such-file.png", shipped.SKIMAGE))
    shipped.content_digest.cache_clear()
    with pytest.raises(UserError, match="'brick' is not in the installed scikit-image"):
        Photographs().digest("brick")
