"""Phases are solved once, for all displays, runs and studies that cannot be told apart by what a method is given."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import torch

from holobench_eval.methods.double_phase import DoublePhase
from holobench_eval.study.cost import Cost
from holobench_eval.study.executors import Serial
from holobench_eval.study.phases import RESULTS, Phases, Solution, phases_of
from holobench_eval.study.plan import FLOORS, REFERENCE
from holobench_eval.study.running.run import Outcome
from holobench_eval.study.store import Store
from tests.study.studies import TURNS, add_one_laser, add_other_profile, compute, exchanged, planned, write_ideal
from tests.support.studies import trained_study
from tests.support.studies.fake_study import untimed, write_config

pytestmark = pytest.mark.usefixtures("no_physics")
SOLUTION = Solution(torch.linspace(-4, 4, 24).view(2, 3, 4), 5, Cost(0.25, 3.5), "has used its 5", "abc", False)
CONFIG = """\
title: "Once"
seed: 3
display: {profiles: [PROFILES], panel: [128, 128]}
targets: {dataset: charts, params: {names: [tv_lines, gray_ramp]}}
methods: [double_phase]
"""


@pytest.fixture
def found(monkeypatch):
    """Where double phase was solved: the targets, in order."""
    names: list[str] = []
    solve = DoublePhase.solve

    def counted(self: DoublePhase, target: torch.Tensor, bench: Any) -> torch.Tensor:
        names.append(bench.target_name)
        return solve(self, target, bench)

    monkeypatch.setattr(DoublePhase, "solve", counted)
    return names


def write_study(folder: Path, displays: int = 1, *changes: tuple[str, str]) -> Path:
    """A study of double phase on displays of the same optics, with pieces of its config exchanged."""
    names = [f"display{number}" for number in range(displays)]
    for name in names:
        write_ideal(folder / f"{name}.yaml", ("name: ideal", f"name: {name}"))
    text = CONFIG.replace("PROFILES", ", ".join(f"{name}.yaml" for name in names))
    (folder / "study.yaml").write_text(exchanged(text, *changes))
    return folder / "study.yaml"


def scores(outcome: Outcome) -> list[dict[str, float]]:
    assert {record["state"] for record in outcome.records} == {"done"}
    return [record["scores"] for record in outcome.records]


def test_displays_of_the_same_optics_and_studies_beside_share_phases_and_new_repeats_are_solved(tmp_path, found):
    results = tmp_path / RESULTS
    first = compute(write_study(tmp_path), results / "a")
    second = compute(write_study(tmp_path, 3), results / "b", executor=Serial())
    assert len(found) == 2
    assert (first.solved, second.solved) == (2, 0)
    assert [record["reused"] for record in second.records if record["label"] == "double_phase"] == [True] * 6
    assert compute(write_study(tmp_path, 1, ("seed: 3", "seed: 3\nrepeats: 2")), results / "c").solved == 2
    assert len(found) == 4
    alone = compute(write_study(tmp_path, 3), tmp_path / "alone", executor=Serial())
    assert untimed(alone.records) == untimed(second.records)
    assert len(found) == 6  # a folder that lies elsewhere shares nothing


def test_a_method_with_a_camera_is_solved_on_each_display_and_once_on_the_same(tmp_path):
    add_other_profile(tmp_path)
    config = write_config(tmp_path, ("plugins.py:Seeing",), count=1, profiles="ideal, other.yaml")
    assert [compute(config, tmp_path / RESULTS / name).solved for name in "ab"] == [2, 0]


def test_only_studies_of_a_folder_of_results_share_their_phases():
    first, second = (phases_of(Path("here", RESULTS, name)) for name in "ab")
    assert first.folder == second.folder == Path("here", RESULTS, "solved").absolute()
    assert first.own != second.own
    assert phases_of(Path("here", "a")) == Phases(Path("here", "a", "solved"))


@pytest.mark.parametrize("folder", ["there", RESULTS])
def test_a_study_and_its_parts_share_their_phases(folder):
    first = Path("here", folder, "a")
    shared = phases_of(first).folder.absolute()
    assert [phases_of(first / part, part=part).folder.absolute() for part in ("b", "c")] == [shared, shared]
    assert phases_of(first / "b", part="b").own == first / "b" / "solved"
    assert phases_of(first / "b").folder == phases_of(first / "other", part="b").folder.parents[1] / "b" / "solved"


def test_a_phase_that_took_more_than_is_covered_is_that_of_its_output_alone(tmp_path):
    first, second = (phases_of(tmp_path / RESULTS / name) for name in "ab")
    for uncovered in (("an environment variable",), ()):
        first.keep("ab", replace(SOLUTION, uncovered=uncovered))
        read = first.read("ab", None)
        assert read is not None
        assert read.uncovered == uncovered
        assert (second.read("ab", None) is None) == bool(uncovered)
    first.keep("ab", replace(SOLUTION, uncovered=("a child",)))
    first.remove(["ab"])
    assert first.read("ab", None) is None


def test_a_phase_that_is_lost_or_damaged_is_solved_again_to_the_same_scores(tmp_path, found):
    config, output = write_study(tmp_path), tmp_path / "out"
    before = scores(compute(config, output))
    cells = [cell for cell in planned(config).cells if cell.code]
    lost, damaged = (phases_of(output).path(cell.phase_id) for cell in cells)
    lost.unlink()
    damaged.write_bytes(flipped(damaged.read_bytes()))
    Store(output).remove(cell.id for cell in cells)
    assert scores(compute(config, output)) == before
    assert found == ["tv_lines", "gray_ramp"] * 2


def flipped(content: bytes) -> bytes:
    """The bytes of a file with a bit of a phase changed: the middle of the file."""
    middle = len(content) // 2
    return content[:middle] + bytes([content[middle] ^ 64]) + content[middle + 1 :]


def test_a_solution_is_read_as_it_was_kept(tmp_path):
    phases = Phases(tmp_path)
    phases.keep("ab", SOLUTION)
    for learned in ("abc", None):
        read = phases.read("ab", learned)
        assert read is not None
        assert torch.equal(read.phase, SOLUTION.phase)
        assert replace(read, phase=SOLUTION.phase) == replace(SOLUTION, reused=True)
    assert phases.read("ab") is None
    assert phases.read("ab", "abd") is None  # of another training
    assert phases.read("cd", None) is None
    phases.remove(["ab", "cd"])
    assert phases.read("ab", None) is None
    phases.keep("ab", SOLUTION)
    phases.path("ab").rename(phases.path("cd"))
    assert phases.read("cd", None) is None  # of another name


def test_a_damaged_file_is_never_a_phase(tmp_path):
    phases = Phases(tmp_path)
    phases.keep("ab", SOLUTION)
    file, whole = phases.path("ab"), phases.path("ab").read_bytes()
    for position in range(0, len(whole), 7):
        file.write_bytes(whole[:position])
        assert phases.read("ab", None) is None
        file.write_bytes(whole[:position] + bytes([whole[position] ^ 1]) + whole[position + 1 :])
        read = phases.read("ab", None)
        assert read is None or torch.equal(read.phase, SOLUTION.phase)
    for content in ({}, {"phase": 3}, {"phase": SOLUTION.phase}, [SOLUTION.phase]):
        torch.save(content, file)
        assert phases.read("ab", None) is None


def test_a_time_is_measured_alone_though_the_phase_is_known_from_a_shared_run(tmp_path, found):
    results = tmp_path / RESULTS
    shared = compute(write_study(tmp_path), results / "a", executor=TURNS)
    config = write_study(tmp_path, 1, ("seed: 3", "seed: 3\ntiming: alone"))
    alone = compute(config, results / "b", executor=TURNS)
    assert found == ["tv_lines", "gray_ramp", "gray_ramp"]
    assert [(record["alone"], record["reused"]) for record in alone.records[-2:]] == [(False, True), (True, False)]
    assert scores(alone) == scores(shared)
    compute(config, results / "c", executor=TURNS)  # what was timed alone once need not be again
    assert len(found) == 3


def test_training_again_makes_the_phases_and_cells_of_what_was_trained_again_and_no_others(tmp_path):
    config = trained_study.write(tmp_path, ("methods: [", 'methods: ["trained.py:Even", '))
    first = trained_study.compute(config)
    phases = phases_of(tmp_path / "out")
    even, gain = (phases.path(cell.phase_id) for cell in planned(config).cells if cell.code)
    before = [file.stat().st_mtime_ns for file in (even, gain)]
    again = trained_study.compute(config, retrain=True)
    assert (first.computed, again.computed, again.solved) == (7, 1, 1)
    assert trained_study.rounds(tmp_path) == [0, 1, 0, 1]
    assert again.records[-1]["scores"] == first.records[-1]["scores"]
    after = [file.stat().st_mtime_ns for file in (even, gain)]
    assert after[0] == before[0]
    assert after[1] > before[1]


def test_the_grid_is_methods_by_displays_by_targets_by_repeats(tmp_path):
    add_other_profile(tmp_path)
    config = write_config(tmp_path, ("plugins.py:Toy", "plugins.py:Seeing"), profiles="ideal, other.yaml")
    config.write_text(config.read_text() + "repeats: 4\n")
    cells = planned(config).cells
    assert len(cells) == 3 * len(FLOORS) + 2 * 2 * 3 * 4
    assert len({cell.id for cell in cells}) == len(cells)


def test_a_method_on_some_displays_has_cells_on_those_only(tmp_path):
    add_other_profile(tmp_path)
    entry = '{name: "plugins.py:Toy", profiles: [other.yaml]}'
    grid = planned(write_config(tmp_path, (entry,), profiles="ideal, other.yaml", count=1))
    assert [cell.condition for cell in grid.cells] == [REFERENCE] * 5 + ["other"]


def test_a_blind_method_is_solved_once_for_displays_of_equal_optics_and_a_seeing_one_on_each(tmp_path):
    add_other_profile(tmp_path)

    def solved(method: str = "plugins.py:Toy") -> list[int]:
        tasks = planned(write_config(tmp_path, (method,), profiles="ideal, other.yaml", count=1)).tasks
        return [len(task.cells) for task in tasks if not task.is_floor]

    assert solved() == [2]
    assert solved("plugins.py:Seeing") == solved("oracle") == [1, 1]
    different = (tmp_path / "other.yaml").read_text().replace("distance: 0.1 ", "distance: 0.2 ")
    (tmp_path / "other.yaml").write_text(different)
    assert solved() == [1, 1]


def test_the_wrong_target_is_the_next_one_and_a_single_target_has_none(tmp_path):
    wrong = {
        c.target: c.params["target"] for c in planned(write_config(tmp_path)).cells if c.method == "floor_wrong_target"
    }
    assert wrong == {"gray 0": "gray 1", "gray 1": "gray 2", "gray 2": "gray 0"}
    assert set(FLOORS) - {cell.method for cell in planned(write_config(tmp_path, count=1)).cells} == {
        "floor_wrong_target"
    }


def test_a_display_with_targets_of_other_colours_has_floors_of_its_own(tmp_path):
    add_one_laser(tmp_path)

    def floors(profiles: str) -> dict[str, set[str]]:
        found: dict[str, set[str]] = {}
        for task in planned(write_config(tmp_path, profiles=profiles)).tasks:
            for cell in task.cells if task.is_floor else ():
                found.setdefault(cell.condition, set()).add(cell.id)
        return found

    colour, gray = floors("ideal, other.yaml"), floors("one.yaml")
    assert set(colour) == set(gray) == {REFERENCE}
    assert floors("ideal, other.yaml, one.yaml") == colour | {"reference for one": gray[REFERENCE]}
