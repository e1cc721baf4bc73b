from pathlib import Path

import pytest

from holobench_eval.core.errors import UserError
from holobench_eval.study import cost
from holobench_eval.study.config import load_study
from tests.study.studies import compute, planned
from tests.support import plugins
from tests.support.studies.fake_study import write_config

pytestmark = pytest.mark.usefixtures("no_physics")

METHODS = plugins.text("budgets")


def study_of(folder: Path, *methods: str) -> Path:
    (folder / "camera.py").write_text(METHODS)
    return write_config(folder, tuple(f"{{name: camera.py:{method}}}" for method in methods), count=1)


def test_a_method_over_its_budget_is_stopped_by_the_display_and_its_best_hologram_is_scored(tmp_path):
    methods = [f"{name}, captures: 3" for name in ("greedy", "deaf", "modest")]
    config = study_of(tmp_path, *methods, "greedy, label: none, captures: 2, params: {keeps: false}", "lying")
    found = compute(config, tmp_path / "out").records
    greedy, deaf, modest, none, lying = (record for record in found if record["cell"]["condition"] != "reference")
    for stopped in (greedy, deaf):
        assert (stopped["state"], stopped["captures"], stopped["scores"]) == ("done", 3, modest["scores"])
        assert stopped["stopped"] == f"{stopped['label']} has used its 3 captures"
    assert (modest["captures"], modest["stopped"], none["state"]) == (3, "", "failed")
    assert none["reason"].startswith("none has used its 2 captures and kept no phase")
    assert (lying["state"], lying.get("stopped", "")) == ("failed", "")


def test_a_budget_makes_another_phase_and_another_time_and_none_leaves_its_name_as_it_was(tmp_path):
    many = ("modest", "modest, label: two, captures: 2", "modest, label: three, captures: 3")
    tasks = [task for task in planned(study_of(tmp_path, *many)).tasks if not task.is_floor]
    free, two, _ = (task.cells[0] for task in tasks)
    assert "captures" not in free.phase
    assert two.phase == {**free.phase, "captures": 2}
    assert two.id != free.id
    assert len({cost.key(task, 1, 1) for task in tasks}) == 3


@pytest.mark.parametrize(
    ("method", "message"),
    [
        ('"plugins.py:Toy", captures: 3', r":6:\d+: .*plugins.py:Toy' takes no captures .*remove 'captures'"),
        ("camera.py:modest, captures: 0", r":6:\d+: .*captures"),
        ("camera.py:modest, captures: many", r":6:\d+: .*captures"),
    ],
)
def test_a_budget_that_means_nothing_is_refused_in_its_place(tmp_path, method, message):
    (tmp_path / "camera.py").write_text(METHODS)
    with pytest.raises(UserError, match=message):
        load_study(write_config(tmp_path, (f"{{name: {method}}}",), count=1))
