"""The page on the physics has every stage of the bench, in light's order, and a picture of it."""

import importlib
import re
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pytest
import torch

from holobench_eval.display.simulated.profile import STAGES

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "physics" / "stages.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def pictures() -> Iterator[ModuleType]:
    """The module that draws, which is no part of the package."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(DOCS / "sphinx"))
        yield importlib.import_module("stage_pictures")


def test_the_page_has_a_section_for_every_stage_in_the_order_of_the_light() -> None:
    sections = re.findall(r"^## (.+?)$.*?^```\{stage\} (\w+)$", PAGE, re.MULTILINE | re.DOTALL)
    assert [key for _, key in sections] == list(STAGES)
    assert [title.lower() for title, _ in sections] == [stage.title for stage in STAGES.values()]


def test_every_stage_has_a_picture(pictures: ModuleType) -> None:
    assert list(pictures.SHOWN) == list(STAGES)


@pytest.mark.parametrize("name", STAGES)
def test_a_picture_differs_by_its_stage_alone(pictures: ModuleType, name: str) -> None:
    without, profile = pictures.with_stage(name)
    changed = {key for key in STAGES if getattr(without, key) != getattr(profile, key)}
    own = {"dust_plane": {"coherent_noise"}, "flicker": set()}  # the first has no keys of its own, the second is a gain
    assert changed == own.get(name, {name})
    assert changed or pictures.SHOWN[name].gain != 1


def test_the_stage_changes_the_light(pictures: ModuleType) -> None:
    without, profile = pictures.with_stage("zero_order")
    target, phase = pictures.hologram(without.panel)
    shown = pictures.SHOWN["zero_order"]
    before, after = (pictures.seen(each, phase, target, shown) for each in (without, profile))
    assert before.psnr > after.psnr + 10
    assert not torch.equal(before.light, after.light)
