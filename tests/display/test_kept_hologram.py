from types import SimpleNamespace

import pytest
import torch

from holobench_eval.core.errors import CellError
from holobench_eval.display import load_profile
from holobench_eval.display.metered import MeteredDisplay

PANEL = (96, 128)


@pytest.fixture
def handle():
    spec = load_profile("ideal").scaled(PANEL).spec()
    return MeteredDisplay(SimpleNamespace(spec=spec), "mine", torch.ones(3, *spec.region.shape), ("t", 0), budget=7)


def test_the_last_hologram_handed_in_is_kept_as_it_was(handle):
    phase = torch.rand(3, *PANEL, requires_grad=True)
    before = phase.detach().clone()
    assert handle.kept is None
    handle.keep(torch.ones(1, 3, *PANEL))  # a batch of one
    assert torch.equal(handle.kept, torch.ones(3, *PANEL))
    handle.keep(phase)
    with torch.no_grad():
        phase.zero_()
    assert torch.equal(handle.kept, before)
    assert not handle.kept.requires_grad


@pytest.mark.parametrize("wrong", [(2, 3, *PANEL), (3, 10, 10)])
def test_what_no_display_can_show_is_not_kept(handle, wrong):
    handle.keep(torch.ones(3, *PANEL))
    with pytest.raises(CellError, match=r"mine: phase (is|has)"):
        handle.keep(torch.zeros(wrong))
    assert torch.equal(handle.kept, torch.ones(3, *PANEL))


def test_a_method_may_know_its_budget_and_not_change_it(handle):
    assert handle.budget == 7
    with pytest.raises(AttributeError):
        handle.budget = 8
