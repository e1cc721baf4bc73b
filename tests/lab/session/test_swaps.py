"""Photographs of one target that changed places are found by the grain of each hologram, or said to be too alike."""

import itertools
from dataclasses import replace
from pathlib import Path

import numpy as np

from holobench_eval.lab.session import Pattern, read_manifest
from holobench_eval.lab.session.checks import check_swaps, grain
from tests.lab.session.running import exported, told
from tests.support.photographing import Lab

METHODS = (
    "double_phase, {name: wirtinger, params: {iterations: 30}}, "
    "{name: wirtinger, label: rough, params: {iterations: 30, initial_phase: random}}"
)


def swap(first: Path, second: Path) -> None:
    content = first.read_bytes(), second.read_bytes()
    first.write_bytes(content[1])
    second.write_bytes(content[0])


def test_each_swap_of_two_methods_is_named_in_one_line_and_no_honest_pair_is(tmp_path: Path) -> None:
    folder = exported(tmp_path, METHODS, "leto-2020", "--dark", 900)
    Lab("leto-2020", (144, 144), seed=5).photograph_round(folder, 1)
    shown = [pattern for pattern in read_manifest(folder).patterns if pattern.target]
    pairs = []
    for colour, places in enumerate(itertools.combinations(range(3), 2)):  # another pair of methods in each colour
        of_colour = [pattern for pattern in shown if pattern.colour == colour]
        pairs.append([of_colour[place].capture for place in places])
    for first, second in pairs:
        swap(folder / f"{first}.png", folder / f"{second}.png")
    said, line = told("import", folder)
    for first, second in pairs:
        assert f"wrong order: {first} and {second}, of one target, changed places" in line, said
        swap(folder / f"{first}.png", folder / f"{second}.png")
    assert line.count("wrong order") == 3
    said, line = told("import", folder)
    assert not line
    assert "table.csv" in said
    assert "checks: not photographed" in said
    assert "wrong order" not in said


def pictures(alike: float, seed: int = 0) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Grains of two photographs and of their predictions, of which a part ``alike`` is the same in both."""
    draw = np.random.default_rng(seed)
    common = draw.exponential(size=(100, 100))
    wanted = [alike * common + (1 - alike) * draw.exponential(size=(100, 100)) for _ in range(2)]
    seen = [picture + draw.exponential(size=(100, 100)) for picture in wanted]
    return [grain(each.astype(np.float32)) for each in seen], [grain(each.astype(np.float32)) for each in wanted]


def pattern(number: int) -> Pattern:
    names = {"file": f"patterns/round-1/{number:04d}.png", "capture": f"captures/round-1/{number:04d}"}
    return Pattern(1, number, "hologram", 0, 1.0, "0" * 64, f"{number:064d}", target="f" * 64, **names)


PAIR = [pattern(1), pattern(2)]


def test_predictions_that_are_too_alike_are_said_to_be_and_not_guessed_at() -> None:
    seen, wanted = pictures(alike=0.999, seed=1)
    for photographs in (seen, seen[::-1]):
        faults, alike = check_swaps(PAIR, photographs, wanted)
        assert not faults
        assert alike == ["captures/round-1/0001 and captures/round-1/0002"]
    seen, wanted = pictures(alike=0.5)
    assert check_swaps(PAIR, seen, wanted) == ([], [])
    assert check_swaps(PAIR, seen[::-1], wanted)[0]


def test_photographs_that_show_nothing_of_the_predictions_raise_no_alarm() -> None:
    alarms = 0
    for seed in range(50):
        _, wanted = pictures(alike=0.5, seed=seed)
        seen, _ = pictures(alike=0.5, seed=seed + 1000)
        alarms += bool(check_swaps(PAIR, seen, wanted)[0])
    assert alarms == 0


def test_two_showings_of_one_hologram_may_change_places() -> None:
    same = [PAIR[0], replace(PAIR[1], sha256=PAIR[0].sha256)]
    seen, wanted = pictures(alike=0.5)
    assert check_swaps(same, seen[::-1], wanted) == ([], [])


def test_three_photographs_that_moved_on_by_one_are_each_named() -> None:
    draw = np.random.default_rng(3)
    wanted = [grain(draw.exponential(size=(64, 64)).astype(np.float32)) for _ in range(3)]
    three = [*PAIR, pattern(3)]
    faults, _ = check_swaps(three, [wanted[1], wanted[2], wanted[0]], wanted)
    assert [line.split(",")[0] for line in faults] == [
        f"wrong order: captures/round-1/000{place} shows pattern 000{shown}"
        for place, shown in ((1, 2), (2, 3), (3, 1))
    ]
