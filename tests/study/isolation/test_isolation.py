"""A method in a process of its own gives what it gives inside, and its process ends with its call."""

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import torch

from holobench_eval.core.errors import UserError
from holobench_eval.study import isolation
from holobench_eval.study.isolation import process
from holobench_eval.study.isolation.process import process_of
from tests.study.studies import compute, one_line, write_green, write_study
from tests.support import plugins
from tests.support.patience import PATIENCE

METHODS = plugins.text("mine")

SHIPPED = (
    "double_phase",
    "{name: online_camera, captures: 4}",
    "{name: parametric_model, params: {patterns: 2, training: {rounds: 1, images: 2, steps: 4}, "
    "retrieval: {iterations: 3}}}",
    "{name: oracle, params: {start_iterations: 1, rounds: 1, iterations: 2}}",
)
"""One that is computed at once, and one each that photographs, that learns and that looks into the bench."""


@pytest.fixture
def file(tmp_path):
    (tmp_path / "mine.py").write_text(METHODS)
    return str(tmp_path / "mine.py")


def digits(records: list[dict[str, Any]]) -> list[Any]:
    return [[record["label"], record["state"], record["scores"], record["captures"]] for record in records]


def test_what_a_method_declares_is_known_without_its_code(file):
    cls, method = isolation.find(f"{file}:Mine", Path()), isolation.build(f"{file}:Mine", {}, Path())
    declared = cls.camera, cls.tuned, hasattr(cls, "predict"), hasattr(cls, "trains")
    assert (cls.__name__, cls.__doc__, *declared) == (
        *("Mine", "Flat phases.\n\nAnd more."),
        *(True, "on nothing", False, False),
    )
    assert (isolation.params_of(method), method.available()) == ({"level": 1.0}, None)
    assert isolation.build(f"{file}:Mine", {"level": 0.0}, Path()).available() == "no level"


@pytest.mark.parametrize(
    ("name", "params", "message"),
    [
        ("Mine", {"levl": 1.0}, "has no parameter 'levl'; did you mean 'level'"),
        ("Mine", {"level": "much"}, "parameter 'level': input should be a valid number"),
        ("Odd", {}, "camera should be True or False"),
        ("None", {}, "has no 'None'"),
    ],
)
def test_what_is_wrong_with_a_method_is_told_in_one_line(file, name, params, message):
    with one_line(message):
        isolation.build(f"{file}:{name}", params, Path())


THREADS = (
    "from threading import Event, Thread\nThread(target=Event().wait, daemon=True).start()\n\n\n"
    "def Any(target, bench): ...\n"
)
ABORTS = (
    "import os\nfrom dataclasses import dataclass\n\n@dataclass(frozen=True)\nclass Any:\n"
    "    def __post_init__(self):\n        os.abort()\n\n    def solve(self, target, bench):\n        return target\n"
)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("import os; os._exit(0)", "ends.py:Any'.*import"),
        ("raise KeyboardInterrupt", "ends.py:Any'.*import"),
        ("raise SystemExit(0)", "ends.py:Any'.*import"),
        (THREADS, "starts threads while its file is imported"),
        (ABORTS, "'ends.py:Any' does not give its parameters: .*SIGABRT"),
    ],
)
def test_a_file_that_cannot_be_a_method_s_is_refused_in_one_line(tmp_path, text, message):
    (tmp_path / "ends.py").write_text(text)
    with pytest.raises(UserError, match=message):
        isolation.build("ends.py:Any", {}, tmp_path)


def test_a_method_is_imported_once_until_a_file_beside_it_changes(file):
    first = process_of(f"{file}:Mine", Path())
    assert process_of(f"{file}:Mine", Path()) is first
    assert first.facts.seconds > 0.05
    Path(file).with_name("beside.py").write_text("LEVEL = 2")
    assert process_of(f"{file}:Mine", Path()) is not first


LEARNS = plugins.text("learns")
LEAVES = "{dataset: dead_leaves, params: {count: 3}, held_out: 1, captures: 60}"


def computed(folder: Path, isolation: str, *methods: str, profile: str = "green.yaml") -> list[Any]:
    """The digits of a study, if not told otherwise of one laser."""
    folder.mkdir()
    write_green(folder, "leto-mild")
    for name in ("mine", "learns"):
        (folder / f"{name}.py").write_text(plugins.text(name))
    display = f"{{profiles: [{profile}], panel: [128, 160]}}"
    config = write_study(folder / "study.yaml", *methods, display=display, training=LEAVES, isolation=isolation)
    found = digits(compute(config, folder / "out").records)
    assert list((folder / "artifacts").iterdir())  # each has trained for itself
    return found


@pytest.mark.slow
def test_what_ships_has_the_digits_that_it_has_inside(tmp_path):
    apart, inside = (computed(tmp_path / where, where, *SHIPPED) for where in ("process", "files"))
    assert apart == inside
    assert {state for _, state, *_ in apart} == {"done"}


def test_what_a_method_computes_and_learns_apart_is_what_it_has_inside(tmp_path):
    mine = "{name: 'mine.py:Mine', captures: 3}", "{name: 'mine.py:Mine', label: short, captures: 1}"
    apart, inside = (
        computed(tmp_path / where, where, "'learns.py:Learns'", *mine, profile="leto-mild")
        for where in ("files", "none")
    )
    assert apart == inside
    found = {label: (state, captures) for label, state, _, captures in apart}
    assert (found["Learns"], found["Mine"], found["short"][1]) == (("done", 0), ("done", 2), 1)


def test_what_cannot_be_kept_is_refused_where_it_was_learned(tmp_path, no_physics):
    (tmp_path / "learns.py").write_text(LEARNS)
    odd = "{name: 'learns.py:Learns', params: {odd: true}}"
    config = write_study(tmp_path / "study.yaml", odd, training=LEAVES)
    reason = compute(config, tmp_path / "out").records[-1]["reason"]
    assert "what prepare returned: a value is object; expected tensors" in reason


def test_a_privileged_method_of_a_file_is_refused_where_the_bench_is_not(tmp_path):
    text = METHODS.replace("camera: ClassVar[bool] = True", "privileged: ClassVar[bool] = True")
    (tmp_path / "mine.py").write_text(text)
    config = write_study(tmp_path / "study.yaml", "'mine.py:Mine'")
    with pytest.raises(UserError, match=r"study.yaml:5:.*looks into the simulated bench.*isolation: none"):
        compute(config, tmp_path / "out")


def test_paths_that_a_method_names_are_known_apart_and_its_call_has_the_threads_of_the_harness(tmp_path):
    (tmp_path / "named.py").write_text(
        "import torch\nfrom pathlib import Path\n\n\ndef named(target, bench): ...\n\n\n"
        "named.files = lambda item: [Path(item)]\nnamed.available = lambda: str(torch.get_num_threads())\n"
        "named.external = lambda: {'weights': Path('weights.pt'), 'none': None}\n"
    )
    before = torch.get_num_threads()
    torch.set_num_threads(3)
    try:
        method = isolation.build("named.py:named", {}, tmp_path)
        found = method.files("a.npy"), method.external(), method.available()
    finally:
        torch.set_num_threads(before)
    assert found == (["a.npy"], {"weights": "weights.pt", "none": None}, "3")


def solved(tmp_path: Path, body: str, top: str = "", **more: str) -> dict[str, Any]:
    """The record of a method of a file, from what is at its top and in its ``solve``."""
    answer = "return torch.zeros((*target.shape[:2], *bench.spec.shape))"
    code = f"import os, time\nimport torch\n{top}\n\n\ndef one(target, bench):\n    {body}\n    {answer}\n"
    (tmp_path / "one.py").write_text(code)
    config = write_study(tmp_path / "study.yaml", "'one.py:one'", limits="{seconds: 60}", **more)
    (record,) = (r for r in compute(config, tmp_path / "out").records if r["label"] == "one")
    return record


def test_time_and_memory_are_those_of_the_call(tmp_path, no_physics):
    record = solved(tmp_path, "held = torch.ones(2**26); time.sleep(0.3)")
    assert 0.3 < record["seconds"] < 20
    assert record["memory_mib"] is None or 250 < record["memory_mib"] < 400  # 256 MiB are held


def test_what_a_method_leaves_running_does_not_keep_its_end_from_the_harness(tmp_path, no_physics):
    record = solved(tmp_path, "(os.fork() or time.sleep(10_000)) and os._exit(3)")
    assert "ended with exit code 3" in record["reason"]


def test_a_file_that_imports_the_bench_runs_inside_alone(tmp_path, no_physics):
    top = "from holobench_eval.display.simulated.profile import load_profile"
    with pytest.raises(UserError, match=r"one.py:one' imports holobench_eval.display.simulated.*'isolation: none'"):
        solved(tmp_path, "load_profile(bench.spec.name)", top)
    assert solved(tmp_path, "load_profile(bench.spec.name)", top, isolation="none")["state"] == "done"


def test_methods_of_other_studies_end_and_keep_no_files_open(tmp_path, monkeypatch):
    monkeypatch.setattr(process, "KEPT", 2)
    monkeypatch.setattr(process, "_processes", [])
    counts = []
    for number in range(6):
        (tmp_path / str(number)).mkdir()
        (tmp_path / str(number) / "mine.py").write_text("def Mine(target, bench):\n    return target\n")
        isolation.build("mine.py:Mine", {}, tmp_path / str(number))
        counts.append(len(list(Path("/proc/self/fd").iterdir())))
    names = [f"mine.py:{name}" for name in ("One", "Two", "Three", "Four")]
    (tmp_path / "mine.py").write_text("def One(target, bench):\n    return target\n\n\nTwo = Three = Four = One\n")
    of_one_study = [[process.process_of(name, tmp_path) for name in names] for _ in range(2)]
    for kept in process._processes:
        kept.end()
    assert counts[-1] == counts[3]
    assert of_one_study[0] == of_one_study[1]  # however many there are


def test_a_plain_script_runs_beside_files_named_like_modules_and_ends_though_a_file_is_deaf(tmp_path):
    (tmp_path / "work").mkdir()
    deaf = "import signal\nsignal.signal(signal.SIGTERM, signal.SIG_IGN)\n"
    (tmp_path / "work/random.py").write_text(f"{deaf}def Mine(target, bench):\n    return target\n")
    (tmp_path / "work/tempfile.py").write_text("import os\nos.abort()\n")
    (tmp_path / "script.py").write_text(  # without ``if __name__ == "__main__"``
        "import os\nfrom pathlib import Path\nfrom holobench_eval.study import isolation\n"
        "assert 'PYTHONSAFEPATH' not in os.environ\nprint(isolation.find('random.py:Mine', Path('.')))\n"
    )
    command = [sys.executable, "../script.py"]
    done = subprocess.run(command, cwd=tmp_path / "work", timeout=PATIENCE, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout.count("Mine")) == (0, 1), done.stderr


def test_a_method_s_own_processes_know_its_file(tmp_path, no_physics):
    top = "import multiprocessing\n\n\ndef half(number):\n    return number / 2"
    body = "with multiprocessing.Pool(1) as pool:\n            assert pool.map(half, [4.0]) == [2.0]"
    assert solved(tmp_path, body, top)["reason"] == ""
