"""Crops at native resolution."""

import itertools
from collections import Counter

import numpy as np
import pytest
import torch
from matplotlib import cbook
from PIL import Image

from holobench_eval.core.errors import UserError
from holobench_eval.datasets import crops, shipped
from holobench_eval.datasets.base import clusters_of, from_srgb, named_digest
from holobench_eval.datasets.crops import FLAT, NAMES, Crops
from holobench_eval.datasets.still_life import still_life
from holobench_eval.display import load_profile


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


def test_crops_of_a_photograph_are_disjoint_and_inside_it():
    for name in NAMES:
        height, width = shipped.decoded(name).shape[1:]
        places = [crop for _, crop in crops._best(name, 208, 100)]
        assert all(0 <= top <= height - 208 and 0 <= left <= width - 208 for _, top, left in places)
        for one, other in itertools.combinations(places, 2):
            assert max(abs(one.top - other.top), abs(one.left - other.left)) >= 208


def test_the_middle_of_a_photograph_comes_first_and_flat_crops_are_left_out():
    assert Crops(names=("moon",), each=4, renderings=0).items() == ["moon-1"]  # of four squares
    for place in ((48, 256), (256, 48), (256, 256)):
        assert crops._contrast(crops._cut(crops.Crop("moon", *place), (208, 208))) < FLAT
    assert Crops(names=("hubble_deep_field",), each=1).items()[0] == "hubble_deep_field-6"  # of four by four
    assert Crops(names=("motorcycle",), each=1).items()[0] == "motorcycle-2"  # of two rows of three


def test_renderings_are_drawn_in_the_shape_asked_for_and_each_is_a_cluster():
    dataset = Crops(names=("coins",), renderings=3)
    assert dataset.items() == ["coins-1", "landscape-1", "street-1", "table-1"]
    assert dataset.load("landscape-1", (100, 210)).shape == (3, 100, 210)
    assert [dataset.cluster(item) for item in dataset.items()] == ["coins", *dataset.items()[1:]]


def test_two_renderings_are_the_still_lifes_of_earlier_studies_and_one_cluster():
    dataset = Crops(names=("coins",), renderings=2)
    assert dataset.items() == ["coins-1", "still-life-1", "still-life-2"]
    assert [dataset.cluster(item) for item in dataset.items()] == ["coins", "still-life", "still-life"]
    assert len(set(clusters_of(Crops(each=2, renderings=2)).values())) == 15
    assert dataset.digest("still-life-1") == named_digest("still-life-1", 1)
    assert torch.equal(
        dataset.load("still-life-1", (40, 40)).permute(1, 2, 0),
        torch.from_numpy(still_life("still-life-1", (40, 40))[0]).float(),
    )


def test_a_region_larger_than_a_crop_is_one_line():
    with pytest.raises(UserError, match="208 x 208 pixels has no room for a target of 877 x 1560"):
        Crops().load("coins-1", (877, 1560))
