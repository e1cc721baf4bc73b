import json

import pytest

from holobench_eval.study.config import load_study
from holobench_eval.study.displays import displays
from tests.study.studies import assert_refused, planned
from tests.support.studies.trained_study import compute, needs, rounds, write

LEARNED = ("profiles: [ideal]", 'learned: {method: "trained.py:Gain", profile: ideal, params: {rounds: 3}}')
FAST = "{name: wirtinger, params: {iterations: 3}}"


@pytest.mark.usefixtures("no_physics")
def test_methods_are_shown_on_a_display_that_was_learned(tmp_path):
    methods = f'[{FAST}, "trained.py:Capturing", "trained.py:Peeking", "trained.py:Gain"]'
    config = write(tmp_path, LEARNED, ('["trained.py:Gain"]', methods), ("title: ", "isolation: none\ntitle: "))
    outcome = compute(config)
    found = {record["label"]: record for record in outcome.records}
    reasons = {label: (record["state"], record["reason"]) for label, record in found.items()}
    assert reasons == dict.fromkeys(reasons, ("done", "")) | {
        "Peeking": ("failed", "a learned display has no simulated bench to look into")
    }
    assert {record["cell"]["condition"] for record in outcome.records} == {"reference", "Gain trained on ideal"}
    solved, keys = found["wirtinger"], ("registration_residual_px", "captures", "learned")
    assert [solved[key] for key in keys] == [0, 0, None]
    assert found["Gain"]["learned"]["captures"] == 2
    assert sorted(rounds(tmp_path)) == [0, 0, 1, 1, 2]  # the display in three rounds, the method in two

    again = compute(config, retrain=True)
    assert again.computed == len(outcome.records)  # the floor stands on that display too
    assert [record["scores"] for record in again.records] == [record["scores"] for record in outcome.records]
    assert len(rounds(tmp_path)) == 10


def test_a_learned_display_is_one_more_thing_to_learn_and_another_training_gives_other_cells(tmp_path):
    config = write(tmp_path, LEARNED, ('["trained.py:Gain"]', f'[{FAST}, "trained.py:Gain"]'))
    grid = planned(config)
    (place,) = displays(load_study(config)).values()
    assert place.learned is not None
    assert [needed.params["rounds"] for needed in needs(config)] in ([2, 3], [3, 2])
    assert {needed.display.name for needed in needs(config)} == {"ideal"}
    assert all(place.learned.id in cell.prepared for cell in grid.cells)
    assert json.loads(json.dumps(grid.cells[-1].description())) == grid.cells[-1].description()
    other = planned(write(tmp_path, (LEARNED[0], LEARNED[1].replace("rounds: 3", "rounds: 4"))))
    shown = [
        {cell.id for cell in each.cells if cell.shown_on} for each in (grid, other)
    ]  # floor images need no display
    assert all(shown)
    assert not shown[0] & shown[1]


REFUSED = [
    ("learned: {method: wirtinger, profile: ideal}", "3:29: method 'wirtinger' learns no display"),
    ('learned: {method: "trained.py:Blind", profile: ideal}', "3:29: method 'trained.py:Blind' learns no display"),
    ('learned: {method: "trained.py:Gain", profile: idel}', "3:57: unknown profile 'idel'; did you mean 'ideal'?"),
    ('learned: {method: "trained.py:Gain"}', "3:20: missing key 'profile' in display.learned"),
    ('learned: {method: "trained.py:Gain", profile: ideal, params: {round: 1}}', "3:73: method 'trained.py:Gain' has"),
    ('learned: {method: "trained.py:Gain", profile: ideal}, profiles: [ideal]', "3:20: display.profiles, "),
]


@pytest.mark.parametrize(("display", "message"), REFUSED)
def test_what_is_no_learned_display_is_refused_at_its_place(tmp_path, display, message):
    assert_refused(write(tmp_path, ("profiles: [ideal]", display)), message)


def test_a_learned_display_is_a_prediction_and_does_not_measure_others(tmp_path):
    config = write(tmp_path, LEARNED, ("seed: 3", "seed: 3\nmeasure: prediction"))
    assert_refused(config, "3:10: a learned display is a prediction already")
