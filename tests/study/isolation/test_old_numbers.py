"""No old number stands for what has changed: code and files that a study uses besides the code of its methods."""

import threading
from pathlib import Path
from typing import Any

import pytest

from holobench_eval.study.artifacts import Artifacts
from holobench_eval.study.phases import RESULTS, Phases
from tests.study.studies import TURNS
from tests.study.studies import compute as compute_with
from tests.support import plugins
from tests.support.patience import PATIENCE
from tests.support.studies.trained_study import compute, needs, write

READING = plugins.text("reading")


def reading(folder: Path, amount: float) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "mine.py").write_text(READING)
    (folder / "data.txt").write_text(str(amount))


def using(folder: Path, methods: str, *changes: tuple[str, str]) -> Path:
    """A config with these methods on one target, with pieces exchanged."""
    return write(
        folder, ('methods: ["trained.py:Gain"]', f"protocol: {{metrics: [psnr]}}\nmethods: [{methods}]"), *changes
    )


def psnr(outcome: Any, label: str = "") -> list[float]:
    rows = [row for row in outcome.records if not row["label"].startswith("floor_") and label in row["label"]]
    assert {row["state"] for row in rows} == {"done"}, [row["reason"] for row in rows]
    return [row["scores"]["psnr_linear"] for row in rows]


@pytest.mark.parametrize("use", ["targets", "training"])
def test_a_file_that_images_are_made_with_counts_though_their_digests_do_not_tell(tmp_path, use):
    reading(tmp_path, 1.0)
    method, old = {
        "targets": ("double_phase", '"trained.py:Pictures", params: {count: 1}'),
        "training": ('"trained.py:Gain"', '"trained.py:Unseen"'),
    }[use]
    config = using(tmp_path, method, (old, '"mine.py:Images"'))
    before = compute(config)
    assert compute(config).computed == 0
    (tmp_path / "data.txt").write_text("0.5")
    after = compute(config)
    assert after.computed == (len(before.records) if use == "targets" else 1)
    assert psnr(after) == psnr(compute(config, "fresh"))


def test_the_same_code_at_two_places_reads_what_lies_beside_it(tmp_path):
    reading(tmp_path / "a", 1.0)
    reading(tmp_path / "b", 6.0)
    outcome = compute(using(tmp_path, "{name: 'a/mine.py:Mine', label: a}, {name: 'b/mine.py:Mine', label: b}"))
    assert psnr(outcome, "a") != psnr(outcome, "b")


def test_what_was_learned_is_learned_again_for_another_file_and_scored_again_when_replaced(tmp_path):
    reading(tmp_path, 1.0)
    config = using(tmp_path, "'mine.py:Learning'")
    before = psnr(compute(config))
    assert compute(config).computed == 0
    reading(tmp_path, 6.0)
    after = compute(config)
    assert after.computed == 1
    assert psnr(after) != before
    assert psnr(after) == psnr(compute(config, "fresh"))

    # and where another study has replaced the network
    (needed,) = needs(config)
    artifacts = Artifacts(tmp_path / "artifacts")
    state = {"amount": artifacts.load(needed).state["amount"] / 6}
    artifacts.write(needed, state, {"captures": 0, "seconds": 0.0})
    replaced = compute(config)
    assert replaced.computed == 1
    assert psnr(replaced) == before
    artifacts.remove(needed)
    assert compute(config).computed == 0  # where nothing is there now, nothing else is known


def test_the_file_that_a_hologram_was_made_with_counts_for_its_predictions(tmp_path):
    reading(tmp_path, 1.0)
    probe = ("seed: 3", "seed: 3\nmeasure: prediction\nholograms: {name: 'mine.py:Mine'}")
    config = using(tmp_path, '"trained.py:Even"', probe)
    before = compute(config)
    reading(tmp_path, 6.0)
    after = compute(config)
    assert after.computed == len(before.records)
    assert psnr(after) != psnr(before)


def test_a_parameter_names_a_file_of_the_working_directory_and_code_one_beside_it(tmp_path, monkeypatch):
    reading(tmp_path / "study", 1.0)
    oracle = "{name: oracle, params: {start_iterations: 1, rounds: 1}}"
    config = using(tmp_path / "study", f"'mine.py:Named', 'mine.py:Mine', {oracle}")
    found = []
    for place, amount in (("p", 1.0), ("q", 6.0), ("p", 1.0)):
        reading(tmp_path / place, amount)
        monkeypatch.chdir(tmp_path / place)
        found.append(compute(config))
    assert psnr(found[0], "Named") == psnr(found[2], "Named") != psnr(found[1], "Named")
    assert psnr(found[0], "Mine") == psnr(found[1], "Mine")
    assert psnr(found[0], "oracle")


def test_a_phase_is_solved_by_one_at_a_time(tmp_path):
    phases, order = Phases(tmp_path), list[str]()

    def second() -> None:
        with phases.locked("ab"):
            order.append("second")

    with phases.locked("ab"):
        waiting = threading.Thread(target=second)
        waiting.start()
        waiting.join(0.2)
        order.append("first")
    waiting.join(PATIENCE)
    assert order == ["first", "second"]


def test_a_time_that_holds_one_that_was_shared_was_not_taken_alone(tmp_path):
    config = using(tmp_path, "{name: wirtinger, params: {iterations: 2, offset: none}}")
    shared = compute_with(config, tmp_path / RESULTS / "a", executor=TURNS)
    assert [row["alone"] for row in shared.records if row["label"] == "wirtinger"] == [False]
    config = using(tmp_path, "{name: wirtinger, params: {iterations: 2}}")
    begun = compute(config, f"{RESULTS}/b")
    assert [row["alone"] for row in begun.records if row["label"] == "wirtinger"] == [False]
