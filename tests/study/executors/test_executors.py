import os
import signal
import subprocess
import sys
import threading
import time
from functools import partial
from multiprocessing import forkserver
from pathlib import Path
from socket import AF_UNIX, socket
from typing import Any

import pytest

from holobench_eval.core.errors import UserError
from holobench_eval.study import executors
from holobench_eval.study.executors import Executor, Local, Serial, executor, processes
from holobench_eval.study.running import run as running
from tests.study import studies
from tests.support.patience import PATIENCE, wait_until
from tests.support.studies.fake_study import lose_a_worker, noted_work, solves, write_config

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("no_physics")]


def compute(config: Path, output: Path, chosen: Executor, **options: Any) -> list[dict[str, Any]]:
    return studies.compute(config, output, executor=chosen, **options).records


def untimed(records: list[dict[str, Any]]) -> list[dict[str, Any]]:
    return [{**record, "seconds": None, "memory_mib": None, "cpu_s": None, "alone": None} for record in records]


def test_worker_processes_give_what_one_process_gives_but_for_a_lost_cell(tmp_path, monkeypatch):
    config = write_config(tmp_path)
    serial = compute(config, tmp_path / "serial", Serial())
    monkeypatch.setattr(running, "step", lose_a_worker)
    local = compute(config, tmp_path / "local", Local(2))
    (lost,) = (number for number, record in enumerate(local) if record["state"] != "done")
    gone = local.pop(lost)
    assert (gone["state"], gone["cell"]["target"], gone["reason"][:12]) == ("failed", "gray 1", "KilledWorker")
    assert untimed(local) == untimed(serial[:lost] + serial[lost + 1 :])


def test_one_solution_of_every_row_is_timed_with_nothing_beside_it(tmp_path, monkeypatch):
    methods = tuple(f'{{name: "plugins.py:Toy", label: m{i}, params: {{value: {i}, pause: 0.2}}}}' for i in range(3))
    config = write_config(tmp_path, methods)
    config.write_text(f"{config.read_text()}timing: alone\n")
    monkeypatch.setattr(running, "step", noted_work)
    found = compute(config, tmp_path / "out", Local(2))
    solved = [record for record in found if record["seconds"] is not None]
    timed = [record for record in solved if record["alone"]]
    assert [(record["label"], record["cell"]["target"]) for record in timed] == [(f"m{i}", "gray 2") for i in range(3)]
    assert [record["alone"] for record in solved].count(False) == 6
    spans = [tuple(map(float, line.split()[1:])) for line in solves(tmp_path / "out")]
    overlapping = [any(a < end and start < b for a, b in spans if (a, b) != (start, end)) for start, end in spans]
    assert overlapping[-3:] == [False] * 3
    assert True in overlapping


def test_drawings_are_made_beside_the_cells_and_a_failed_one_costs_nothing(tmp_path):
    class Both(Serial):
        def map(self, function: Any, jobs: Any) -> Any:
            for job in jobs:
                try:
                    result = function(job)
                except Exception as error:
                    result = error
                yield job, result

    drawings = [partial(int, "no number"), partial((tmp_path / "picture").write_text, "drawn")]
    records = compute(write_config(tmp_path), tmp_path / "out", Both(), drawings=drawings)
    assert {record["state"] for record in records} == {"done"}
    assert (tmp_path / "picture").read_text() == "drawn"


def surroundings(number: int) -> tuple[str, str, str]:
    time.sleep(0.2)  # so that the other worker takes the other job
    if number == 2:
        raise ValueError("no light")
    return os.environ["CUDA_VISIBLE_DEVICES"], os.environ["OMP_NUM_THREADS"], str(Path.cwd())


def endless(folder: Path) -> None:
    (folder / str(os.getpid())).touch()
    time.sleep(1000)


def test_workers_have_one_thread_a_gpu_each_and_the_folder_of_the_run_and_return_errors(tmp_path, monkeypatch):
    monkeypatch.setenv("CUDA_VISIBLE_DEVICES", "3,5")
    monkeypatch.setenv("OMP_NUM_THREADS", "7")
    monkeypatch.chdir(tmp_path)
    found = dict(Local(2, gpus=2).map(surroundings, range(3)))
    assert repr(found.pop(2)) == "ValueError('no light')"
    assert sorted(found.values()) == [("3", "1", str(tmp_path)), ("5", "1", str(tmp_path))]  # type: ignore[type-var]
    assert os.environ["OMP_NUM_THREADS"] == "7"


def run_of_two(folder: Path) -> None:
    list(Local(2).map(endless, [folder] * 2))


@pytest.mark.parametrize("ending", [signal.SIGKILL, signal.SIGINT])
def test_workers_end_with_their_run(tmp_path, ending):
    def end(run: int) -> None:
        wait_until(lambda: len(list(tmp_path.iterdir())) == 2)
        os.kill(run, ending)

    if ending == signal.SIGKILL:
        run = processes.start(run_of_two, tmp_path)
        assert run.pid is not None
        end(run.pid)
        run.join(PATIENCE)
    else:
        signal.signal(ending, signal.default_int_handler)  # which dask-jobqueue has replaced where it was imported
        interrupting = threading.Thread(target=end, args=(os.getpid(),))
        interrupting.start()
        with pytest.raises(KeyboardInterrupt):
            run_of_two(tmp_path)
        interrupting.join(PATIENCE)
    wait_until(lambda: not any(Path("/proc", worker.name).exists() for worker in tmp_path.iterdir()))


def test_ctrl_c_while_the_process_of_the_workers_imports_is_quiet(tmp_path):
    (tmp_path / "slow.py").write_text("import time\nopen('importing', 'w').close()\ntime.sleep(1)")
    code = """if True:
        import time
        from holobench_eval.study.executors import processes
        processes.PRELOADED = ["slow"]
        processes.prepare()
        try:
            time.sleep(1000)
        except KeyboardInterrupt:
            print("seen")
    """
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])}
    run = subprocess.Popen([sys.executable, "-c", code], cwd=tmp_path, env=environment, start_new_session=True, **pipes)
    wait_until((tmp_path / "importing").exists)
    os.killpg(run.pid, signal.SIGINT)
    assert run.communicate(timeout=PATIENCE) == ("seen\n", "")


def test_a_process_that_is_killed_while_it_asks_for_another_one_leaves_the_server_to_the_others():
    processes.prepare()
    server: Any = forkserver._forkserver  # type: ignore[attr-defined]
    before = server._forkserver_pid
    for _ in range(3):
        with socket(AF_UNIX) as client:
            client.connect(server._forkserver_address)
        other = processes.start(time.sleep, 0)
        other.join(PATIENCE)
        assert (other.exitcode, server._forkserver_pid) == (0, before)


def test_workers_are_prepared_only_where_they_are_needed(monkeypatch):
    needy = [("local", None, False), ("auto", None, True), ("auto", 2, False)]
    others = [("auto", None, False), ("auto", 1, True), ("local", 1, True), ("serial", None, True), ("slurm", 4, True)]
    begun: list[Any] = []
    monkeypatch.setattr(executors, "_cores", lambda: 2)
    for chosen in needy + others:
        monkeypatch.setattr(executors, "prepare", lambda: begun.append(chosen))  # noqa: B023
        executors.begin(*chosen)
    assert begun == needy


def test_the_serial_executor_takes_a_job_when_it_starts_it():
    taken: list[int] = []
    jobs = (taken.append(number) or number for number in range(3))
    assert next(Serial().map(lambda number: number * 2, jobs)) == (0, 0)
    assert taken == [0]


@pytest.mark.parametrize(
    ("name", "workers", "address", "message"),
    [
        ("loca", None, None, "did you mean 'local'"),
        ("local", 0, None, "at least 1"),
        ("serial", 2, None, "--executor local"),
        ("address", None, None, "belong together"),
        ("local", None, "tcp://a:1", "belong together"),
        ("address", 4, "tcp://a:1", "has its own"),
        ("slurm", None, None, "needs --workers"),
    ],
)
def test_an_executor_that_cannot_be_is_refused(name, workers, address, message):
    with pytest.raises(UserError, match=message):
        executor(name, workers, address=address)
