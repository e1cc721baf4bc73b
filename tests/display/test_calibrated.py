"""What a method may touch of a display: an account of captures, optics, what it hands in, and nothing of the bench."""

import copy
import pickle
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest
import torch

from holobench_eval.core.errors import BudgetError, CellError, StorageError
from holobench_eval.display import CalibratedBench, MeteredDisplay, Profile, load_profile
from holobench_eval.display.account import Account, Journal
from holobench_eval.display.api import white_irradiance
from holobench_eval.display.learned import LearnedBench
from holobench_eval.display.simulated.pipeline import SimulatedBench
from holobench_eval.imaging import Registration
from holobench_eval.methods.wirtinger import Wirtinger
from holobench_eval.study.opening import open_bench
from holobench_eval.testing.propagation_reference import gaussian_beam
from tests.support.toy_camera import SPEC, ToyDisplay, picture

PANEL = (192, 192)


class Camera:
    camera = True


class Privileged:
    privileged = True


@pytest.fixture(scope="module")
def bench():
    return open_bench(load_profile("ideal"), PANEL, seed=3)


@pytest.fixture
def target(bench):
    return gaussian_beam(bench.spec.region.shape, 300e-6).abs().float().expand(3, -1, -1)


def test_captures_are_of_methods_with_a_camera_counted_and_stop_at_the_budget(bench, target):
    blind = bench.for_method(object(), "blind", target, "t", 0)
    with pytest.raises(CellError, match="blind took a capture"):
        blind.capture(torch.zeros(3, *PANEL))
    assert blind.captures == 0
    handle = bench.for_method(Camera(), "camera", target, "t", 0, budget=2)
    image = handle.rectify(handle.capture(torch.zeros(3, *PANEL)))
    assert image.shape == target.shape
    handle.capture(torch.zeros(3, *PANEL))
    with pytest.raises(BudgetError, match="used its 2 captures"):
        handle.capture(torch.zeros(3, *PANEL))
    assert handle.captures == 2


def test_only_frames_that_were_captured_are_rectified(bench, target):
    handle = bench.for_method(Camera(), "camera", target, "t", 0)
    capture = handle.capture(torch.zeros(3, *PANEL))
    for forged in (replace(capture, frame=capture.frame + 1), replace(capture, dark=capture.dark - 1)):
        with pytest.raises(CellError, match="camera: rectify takes a frame as capture returned it"):
            handle.rectify(forged)
    assert handle.rectify(replace(capture)).shape == target.shape
    assert handle.captures == 1


def test_a_method_cannot_reach_the_scored_target_or_its_account_or_unless_privileged_the_simulation(bench, target):
    assert bench.for_method(Privileged(), "oracle", target, "t", 0).simulation.bench is bench.bench
    handle = bench.for_method(Camera(), "m", target, "t", 0)
    with pytest.raises(CellError, match="privileged"):
        _ = handle.simulation
    handle._target.zero_()
    assert float(target.max()) > 0.5
    for name in ("captures", "spec", "simulation"):
        with pytest.raises(AttributeError):
            setattr(handle, name, 0)


def test_random_numbers_depend_on_target_repeat_and_name(bench, target):
    def draw(item, repeat, name):
        return torch.rand(3, generator=bench.for_method(object(), "m", target, item, repeat).generator(name)).tolist()

    assert draw("a", 0, "x") == draw("a", 0, "x")
    assert len({tuple(draw(*names)) for names in (("a", 0, "x"), ("b", 0, "x"), ("a", 1, "x"), ("a", 0, "y"))}) == 4


def test_efficiency_counts_the_light_in_the_region(bench, target):
    """A flat phase sends the light straight through: the region gets its share of the panel."""
    shot = bench.photograph(torch.zeros(3, *PANEL), target, "t", 0)
    with pytest.raises(CellError, match="mine: phase holds 110592 values that are NaN"):
        bench.photograph(torch.full((3, *PANEL), torch.nan), target, "t", 0, label="mine")
    region = bench.spec.region
    assert shot.efficiency == pytest.approx(region.height * region.width / (PANEL[0] * PANEL[1]), rel=0.05)
    assert shot.saturated == 0


def test_exposure_is_equal_for_all_methods_unless_brightness_is_matched(bench, target):
    first = bench.photograph(torch.zeros(3, *PANEL), target, "t", 0)
    bright = bench.photograph(torch.zeros(3, *PANEL), target, "t", 0, exposure="matched")
    assert first.exposure == bench.exposure(target)
    assert bright.exposure != first.exposure
    assert torch.allclose(bright.image, first.image, atol=0.05)


def test_a_handle_gives_the_nominal_optics_and_nothing_of_the_bench(bench, target):
    handle = bench.for_method(object(), "m", target, "t", 0)
    assert handle.spec is bench.spec
    assert torch.isfinite(white_irradiance(torch.zeros(3, 8, 8), bench.spec)).all()  # of a dark target too
    assert torch.equal(handle.light, white_irradiance(target, bench.spec))
    refused, hidden = set(), (CalibratedBench, SimulatedBench, Profile, Registration)
    for name in (name for name in dir(handle) if not name.startswith("_")):
        try:
            assert not isinstance(getattr(handle, name), hidden), name
        except CellError:
            refused.add(name)
    assert refused == {"simulation", "learned", "starts"}


def test_simulation_is_the_mean_capture_in_the_target_frame_and_tells_its_noise(target):
    aged = open_bench(load_profile("leto-aged"), PANEL)
    flat = torch.zeros(3, *PANEL)
    simulated, variance = aged.simulation.expected(flat, target)
    captured = aged.photograph(flat, target, "t", 0).image
    assert float((simulated - captured).norm() / captured.norm()) < 0.03
    assert float((simulated - captured).square().sum()) == pytest.approx(float(variance.sum()), rel=0.05)


def handle(budget: int) -> MeteredDisplay:
    return ToyDisplay().handle(Camera(), picture(), budget)


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy])
def test_a_copy_of_the_handle_shares_its_budget(copied: Callable[[MeteredDisplay], MeteredDisplay]) -> None:
    first = handle(3)
    phase = torch.zeros(len(picture()), *SPEC.shape)
    second = copied(first)
    for display in (first, second, copied(second)):
        display.capture(phase)
    assert first.captures == 3
    for display in (first, second):
        with pytest.raises(BudgetError, match="has used its 3 captures"):
            display.capture(phase)


def test_threads_share_a_budget_and_processes_cannot() -> None:
    account = Account("mine", 100)
    with pytest.raises(TypeError, match="another process"):
        pickle.dumps(account)

    def take(_: int) -> bool:
        try:
            account.take()
        except BudgetError:
            return False
        return True

    with ThreadPoolExecutor(8) as pool:
        assert sum(pool.map(take, range(400))) == account.captures == 100


def test_a_journal_has_the_captures_of_all_accounts_and_a_budget_those_of_one(tmp_path: Path) -> None:
    journal = Journal(tmp_path / "new folder" / "one.captures")
    accounts = [Account("mine", 2, journal=journal) for _ in range(2)]
    for account in accounts:
        account.take()
        account.take()
        with pytest.raises(BudgetError, match="has used its 2 captures"):
            account.take()
    assert [(account.captures, account.total) for account in accounts] == [(2, 2), (2, 4)]
    assert journal.captures == 4
    journal.close()
    journal.close()
    assert journal.captures == 0


def test_a_capture_that_cannot_be_counted_is_not_taken(tmp_path: Path) -> None:
    (tmp_path / "journal").touch()
    display, phase = ToyDisplay(), torch.zeros(len(picture()), *SPEC.shape)
    handle = MeteredDisplay(display, "mine", picture(), (), Camera(), journal=Journal(tmp_path / "journal" / "one"))
    with pytest.raises(StorageError, match="journal"):
        handle.capture(phase)
    assert handle.captures == 0


SMALL = (96, 128)


@pytest.fixture
def keeping():
    spec = load_profile("ideal").scaled(SMALL).spec()
    return MeteredDisplay(SimpleNamespace(spec=spec), "mine", torch.ones(3, *spec.region.shape), ("t", 0), budget=7)


def test_the_last_hologram_handed_in_is_kept_as_it_was(keeping):
    phase = torch.rand(3, *SMALL, requires_grad=True)
    before = phase.detach().clone()
    assert keeping.kept is None
    keeping.keep(torch.ones(1, 3, *SMALL))  # a batch of one
    assert torch.equal(keeping.kept, torch.ones(3, *SMALL))
    keeping.keep(phase)
    with torch.no_grad():
        phase.zero_()
    assert torch.equal(keeping.kept, before)
    assert not keeping.kept.requires_grad


def test_what_no_display_can_show_is_not_kept_and_a_budget_is_known_and_not_changed(keeping):
    keeping.keep(torch.ones(3, *SMALL))
    for wrong in ((2, 3, *SMALL), (3, 10, 10)):
        with pytest.raises(CellError, match=r"mine: phase (is|has)"):
            keeping.keep(torch.zeros(wrong))
    assert torch.equal(keeping.kept, torch.ones(3, *SMALL))
    assert keeping.budget == 7
    with pytest.raises(AttributeError):
        keeping.budget = 8


LEARNED = load_profile("ideal").spec((128, 160))
DRAW = torch.Generator().manual_seed(0)
TARGET = torch.rand(3, *LEARNED.region.shape, generator=DRAW)
PHASE = 6 * torch.rand(3, *LEARNED.shape, generator=DRAW)


class Shade:
    """A network that predicts even light, as bright as it learned and as the phase says."""

    camera = privileged = True  # a predictor gets neither, whatever it declares

    def predict(self, phase, bench):
        assert phase.shape == (1, 3, *LEARNED.shape)
        level = bench.learned["level"] * phase.mean()
        return level.expand(1, 3, *LEARNED.region.shape).clone()


@pytest.fixture
def display():
    return LearnedBench(LEARNED, Shade(), {"level": torch.tensor(0.25, requires_grad=True)}, 3)


def test_a_capture_is_what_the_network_predicts(display):
    shot = display.photograph(PHASE, TARGET, "t", 0)
    assert torch.equal(shot.image, torch.full_like(TARGET, float(0.25 * PHASE.mean())))
    assert torch.equal(display.rectified(shot.capture, TARGET), shot.image)
    assert not shot.image.requires_grad
    assert (shot.saturated, shot.residual) == (0, 0)
    assert shot.efficiency == pytest.approx(float((shot.image.mean((1, 2)) / TARGET.mean((1, 2))).mean()))


class Array(Shade):
    def predict(self, phase, bench):
        return super().predict(phase, bench).detach().numpy()


def test_a_capture_does_not_depend_on_repeat_or_exposure_and_may_be_an_array_of_numpy(display):
    first = display.photograph(PHASE, TARGET, "t", 0).image
    assert torch.equal(first, display.photograph(PHASE, TARGET, "t", 1, exposure="matched").image)
    arrays = LearnedBench(LEARNED, Array(), display.learned, 3)
    assert torch.equal(first, arrays.photograph(PHASE, TARGET, "t", 0).image)


def test_a_method_with_a_camera_sees_what_is_predicted_and_is_counted(display):
    handle = display.for_method(Camera(), "camera", TARGET, "t", 0)
    image = handle.rectify(handle.capture(PHASE))
    assert torch.equal(image.cpu(), display.photograph(PHASE, TARGET, "t", 0).image)
    assert handle.captures == 1


def test_a_method_is_told_that_it_has_no_camera_and_that_there_is_no_bench_to_look_into(display):
    with pytest.raises(CellError, match="blind took a capture, but declares no camera"):  # its own mistake comes first
        display.for_method(object(), "blind", TARGET, "t", 0).capture(PHASE)
    with pytest.raises(CellError, match=r"^a learned display has no simulated bench to look into$"):
        _ = display.for_method(Privileged(), "oracle", TARGET, "t", 0).simulation


def test_what_the_display_learned_is_hidden_from_methods_and_a_wrong_phase_is_refused_by_name(display):
    with pytest.raises(CellError, match=r"^mine: phase"):
        display.photograph(PHASE[:, :5], TARGET, "t", 0, label="mine")
    with pytest.raises(CellError, match="blind was not trained"):
        _ = display.for_method(object(), "blind", TARGET, "t", 0).learned
    assert display.for_method(object(), "own", TARGET, "t", 0, learned={"a": 1}).learned == {"a": 1}


def test_methods_solve_on_a_learned_display_with_random_numbers_of_their_own(display):
    method = Wirtinger(iterations=2, initial_phase="random")
    handles = (display.for_method(method, "w", TARGET, "t", repeat) for repeat in (0, 0, 1))
    first, again, other = (method.solve(TARGET[None], handle) for handle in handles)
    assert first.shape == (1, 3, *LEARNED.shape)
    assert torch.equal(first, again)
    assert not torch.equal(first, other)
