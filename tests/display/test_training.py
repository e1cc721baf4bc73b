import pytest
import torch

from holobench_eval.core.errors import BudgetError, CellError
from holobench_eval.display import load_profile
from holobench_eval.display.training import TrainingBench, TrainingImage
from holobench_eval.study.opening import open_bench
from tests.support.small_training import Memory

PANEL = (128, 128)


@pytest.fixture(scope="module")
def workbench():
    return open_bench(load_profile("leto-mild"), PANEL, seed=3)


@pytest.fixture(scope="module")
def images(workbench):
    draw = torch.Generator().manual_seed(1)
    shape = (3, *workbench.spec.region.shape)
    return [TrainingImage(f"image {i}", torch.rand(shape, generator=draw)) for i in range(3)]


@pytest.fixture
def memory():
    return Memory()


@pytest.fixture
def begin(workbench, images, memory):
    """A training, or the same one going on after a kill: the memory is all that stays."""
    return lambda budget=None, seed=3: TrainingBench(workbench, "mine", images[:2], images[2:], memory, budget, seed)


PHASE = 6 * torch.rand(3, *PANEL, generator=torch.Generator().manual_seed(2))


def test_a_capture_is_the_images_frame_and_as_bright_as_a_scored_one(begin, workbench, images):
    bench = begin()
    capture = bench.photograph(PHASE, images[0], 0)
    scored = workbench.photograph(PHASE, images[0].target, "image 0", 0).image
    assert capture.shape == images[0].target.shape
    assert 0 < float((capture - scored).norm() / scored.norm()) < 0.1  # the noise is another
    assert not torch.equal(bench.photograph(PHASE, images[0], 0, "score"), scored)
    assert bench.spec is workbench.spec
    assert [image.item for image in (*bench.images, *bench.held_out)] == ["image 0", "image 1", "image 2"]
    assert bench.light(images[0]).shape == (3,)


def test_noise_and_random_numbers_depend_on_seed_image_and_names_and_on_nothing_else(begin, images):
    def draw(seed, name):
        return float(torch.rand(1, generator=begin(seed=seed).generator(name)))

    assert draw(3, "a") == draw(3, "a")
    assert len({draw(3, "a"), draw(3, "b"), draw(4, "a")}) == 3
    bench = begin()
    first = bench.photograph(PHASE, images[0], "round", 0)
    bench.photograph(PHASE, images[1], "round", 0)
    assert torch.equal(bench.photograph(PHASE, images[0], "round", 0), first)
    assert torch.equal(begin().photograph(PHASE, images[0], "round", 0), first)
    assert not torch.equal(bench.photograph(PHASE, images[0], "round", 1), first)
    assert not torch.equal(begin(seed=4).photograph(PHASE, images[0], "round", 0), first)


def test_captures_without_a_gradient_are_counted_unless_refused_and_stop_at_the_budget(begin, images):
    bench = begin(budget=2)
    with pytest.raises(CellError, match="mine: phase"):
        bench.photograph(PHASE[:, :5], images[0])
    assert bench.captures == 0
    for number in range(2):
        assert not bench.photograph(PHASE.clone().requires_grad_(), images[number], number).requires_grad
    with pytest.raises(BudgetError, match="mine has used its 2 captures for training"):
        bench.photograph(PHASE, images[2], "held out")
    assert bench.captures == 2


def train(bench, images, rounds, stop_after=None):
    """Rounds of one capture each; stops as a kill would, in the middle of a round that is not kept."""
    kept = []
    for number in range(rounds):

        def make(number=number):
            capture = bench.photograph(PHASE + number, images[number % 2], number)
            if stop_after == number:
                raise KeyboardInterrupt
            return {"capture": capture}

        kept.append(bench.kept(f"round {number}", make)["capture"])
    return torch.stack(kept)


def test_a_training_that_was_stopped_goes_on_where_it_was_and_counts_every_kept_capture_once(begin, images, memory):
    with pytest.raises(KeyboardInterrupt):
        train(begin(budget=4), images, 4, stop_after=2)
    resumed = begin(budget=4)
    found = train(resumed, images, 4)
    assert resumed.captures == 4
    memory.kept.clear()
    whole = begin(budget=4)
    assert torch.equal(train(whole, images, 4), found)
    assert whole.captures == 4


def test_values_loaded_in_any_order_do_not_lower_the_count(begin, images):
    train(begin(), images, 3)
    resumed = begin()
    for name in ("round 2", "round 0", "round 1"):
        assert resumed.load(name) is not None
    assert resumed.captures == 3
    assert resumed.load("absent") is None


def test_time_before_an_interruption_counts_once(begin, memory):
    first = begin()
    first.save("a", {})
    memory.kept["a"]["seconds"] = 100.0
    memory.kept["b"] = {**memory.kept["a"], "seconds": 40.0}
    resumed = begin()
    for name in ("b", "a", "a"):
        resumed.load(name)
    assert 100 <= resumed.seconds < 110


def test_a_kept_value_is_made_once_and_a_saved_one_replaced(begin):
    bench, made = begin(), []
    for _ in range(2):
        assert bench.kept("x", lambda: {"n": len(made.append(1) or made)}) == {"n": 1}
    bench.save("x", {"n": 5})
    assert begin().load("x") == {"n": 5}


def test_a_logged_row_tells_captures_and_time(begin, images, memory):
    bench = begin()
    bench.photograph(PHASE, images[0])
    bench.log(round=1, step=2, l1=0.5)
    assert memory.story == [{"round": 1, "step": 2, "l1": 0.5, "captures": 1}]
    assert memory.rows[0]["seconds"] >= 0
