"""Studies on Dask clusters: a scheduler that runs already, and jobs of a queue that starts them when it likes."""

from __future__ import annotations

import os
import stat
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from holobench_eval.core.errors import UserError
from holobench_eval.study import run as running
from holobench_eval.study import store
from holobench_eval.study.executors import Serial, clusters, executor
from holobench_eval.study.executors.clusters import Address, Slurm
from tests.study.test_executors import compute, untimed
from tests.support.fake_study import fake_work, write_config

SBATCH = """\
#!{python}
import pathlib, subprocess, sys
script = pathlib.Path(sys.argv[-1])
(pathlib.Path({log!r}) / "jobs").open("a").write(script.read_text())
nowhere = dict(stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
job = subprocess.Popen(["bash", str(script)], start_new_session=True, **nowhere)
print("Submitted batch job", job.pid)
"""
SCANCEL = """\
#!{python}
import os, signal, sys
for job in sys.argv[1:]:
    try:
        os.killpg(int(job), signal.SIGTERM)
    except (ValueError, ProcessLookupError):
        pass
"""


@pytest.fixture
def importable(monkeypatch: pytest.MonkeyPatch) -> None:
    """Worker processes find the fake study."""
    here = str(Path(__file__).parents[2])
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([here, os.environ.get("PYTHONPATH", "")]))


@pytest.mark.slow
@pytest.mark.usefixtures("no_physics", "importable")
def test_a_running_scheduler_gives_the_table_of_one_process(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from distributed import LocalCluster

    config = write_config(tmp_path)
    serial = compute(config, tmp_path / "serial", Serial())
    monkeypatch.setattr(running, "step", fake_work)
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        chosen = Address(cluster.scheduler_address)
        assert chosen.workers == 2
        assert untimed(compute(config, tmp_path / "there", chosen)) == untimed(serial)


@pytest.mark.slow
@pytest.mark.usefixtures("no_physics", "importable")
def test_workers_that_were_started_in_another_folder_write_where_the_run_reads(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from distributed import LocalCluster

    config = write_config(tmp_path)
    monkeypatch.setattr(running, "step", fake_work)
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    with LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as cluster:
        monkeypatch.chdir(tmp_path)
        records = compute(Path(config.name), Path("out"), Address(cluster.scheduler_address))
    assert {record["state"] for record in records} == {"done"}
    assert not list((tmp_path / "elsewhere").iterdir())


def test_a_worker_that_does_not_see_the_folder_says_so(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"does not see the folder .*gone"):
        clusters._at_home(str(tmp_path / "gone"), resources, 0)


@pytest.mark.usefixtures("no_physics")
def test_records_that_cannot_be_seen_end_the_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(store, "LATE", 0.0)

    class Elsewhere(Serial):
        def map(self, function: Any, jobs: Any) -> Any:
            for job in jobs:
                yield job, function(replace(job, setting=replace(job.setting, output=tmp_path / "other")))

    with pytest.raises(UserError, match=r"a worker has written a record that is not in .*out/records; workers have to"):
        compute(write_config(tmp_path), tmp_path / "out", Elsewhere())


def test_workers_with_several_threads_are_refused() -> None:
    from distributed import LocalCluster

    with (
        LocalCluster(n_workers=1, threads_per_worker=2, processes=False, dashboard_address=None) as cluster,
        pytest.raises(UserError, match="start workers with --nthreads 1"),
    ):
        _ = Address(cluster.scheduler_address).workers


@pytest.mark.slow
@pytest.mark.parametrize("waiting", [False, True], ids=["with a job", "before its first job"])
def test_a_scheduler_that_goes_away_ends_the_run_in_one_line(monkeypatch: pytest.MonkeyPatch, waiting: bool) -> None:
    from distributed import LocalCluster

    monkeypatch.setattr(clusters, "ANSWER", 2.0)
    with LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as cluster:

        def jobs() -> Iterator[float]:
            if waiting:
                cluster.close()
                time.sleep(0.5)  # until the client has seen it
            else:
                threading.Timer(1.0, cluster.close).start()
            yield 30.0

        with pytest.raises(UserError, match="the Dask scheduler went away; what is finished is kept"):
            list(Address(cluster.scheduler_address).map(time.sleep, jobs()))


def test_a_scheduler_that_does_not_answer_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("holobench_eval.study.executors.clusters.ANSWER", 1.0)
    with pytest.raises(UserError, match="no Dask scheduler answers at 'tcp:") as caught:
        _ = Address("tcp://127.0.0.1:9").workers
    assert "\n" not in str(caught.value)


def resources(_: int) -> dict[str, float]:
    """What the worker that computes this declares."""
    from distributed import get_worker

    return dict(get_worker().state.total_resources)


@pytest.fixture
def one_gpu_of_two() -> Iterator[str]:
    """The address of a scheduler with two workers, one of which declares a GPU."""
    from distributed import Client, Scheduler, SpecCluster, Worker

    workers: dict[str, dict[str, Any]] = {
        name: {"cls": Worker, "options": {"nthreads": 1, "resources": declared}}
        for name, declared in (("plain", None), ("graphics", {"GPU": 1}))
    }
    scheduler = {"cls": Scheduler, "options": {"dashboard": False, "port": 0}}
    with SpecCluster(workers=workers, scheduler=scheduler, silence_logs=50) as cluster, Client(cluster) as client:
        client.wait_for_workers(2)
        yield cluster.scheduler_address


def test_on_a_gpu_every_job_goes_to_a_worker_that_declares_one(one_gpu_of_two: str) -> None:
    chosen = Address(one_gpu_of_two, on_gpu=True)
    assert chosen.workers == 1
    assert [found for _, found in chosen.map(resources, range(6))] == [{"GPU": 1}] * 6


def test_on_the_cpu_workers_that_declare_a_gpu_are_workers_like_others(one_gpu_of_two: str) -> None:
    chosen = Address(one_gpu_of_two)
    assert chosen.workers == 2
    assert {len(found) for _, found in chosen.map(resources, range(6)) if isinstance(found, dict)} == {0, 1}


def test_a_scheduler_without_a_gpu_says_how_to_start_a_worker_with_one() -> None:
    from distributed import LocalCluster

    with LocalCluster(n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None) as cluster:
        address = cluster.scheduler_address
        with pytest.raises(UserError, match="declares a GPU; start one with: ") as caught:
            _ = Address(address, on_gpu=True).workers
    assert f'dask worker {address} --nthreads 1 --resources "GPU=1"' in str(caught.value)


@pytest.fixture
def queue(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A SLURM queue that starts every job at once, and the file that it keeps their scripts in."""
    pytest.importorskip("dask_jobqueue")
    import dask

    tools = tmp_path / "bin"
    tools.mkdir()
    for name, text in (("sbatch", SBATCH), ("scancel", SCANCEL)):
        tool = tools / name
        tool.write_text(text.format(python=sys.executable, log=str(tmp_path)))
        tool.chmod(tool.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setenv("PATH", f"{tools}{os.pathsep}{os.environ['PATH']}")
    site = {"queue": "normal", "cores": 1, "memory": "2GB", "interface": None, "local-directory": str(tmp_path)}
    with dask.config.set({"jobqueue.slurm": {**dask.config.get("jobqueue.slurm", {}), **site}}):
        yield tmp_path / "jobs"


@pytest.mark.slow
@pytest.mark.usefixtures("no_physics", "importable")
def test_a_slurm_queue_gives_the_table_of_one_process(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, queue: Path
) -> None:
    config = write_config(tmp_path)
    serial = compute(config, tmp_path / "serial", Serial())
    monkeypatch.setattr(running, "step", fake_work)
    assert untimed(compute(config, tmp_path / "queued", Slurm(2))) == untimed(serial)
    script = queue.read_text()
    assert script.count("#SBATCH -J") == 2
    assert "export OMP_NUM_THREADS=1" in script
    assert "--resources" not in script


@pytest.mark.slow
@pytest.mark.usefixtures("importable")
def test_jobs_of_a_slurm_queue_on_gpus_run_on_workers_that_declare_one_beside_the_sites_own_arguments(
    queue: Path,
) -> None:
    import dask

    with dask.config.set({"jobqueue.slurm.worker-extra-args": ["--lifetime", "1h"]}):
        assert [found for _, found in Slurm(1, on_gpu=True).map(resources, range(2))] == [{"GPU": 1}] * 2
    assert "--lifetime 1h --resources GPU=1" in queue.read_text()


@pytest.mark.parametrize(
    ("name", "workers", "address", "message"),
    [
        ("address", None, None, "belong together"),
        ("local", None, "tcp://a:1", "belong together"),
        ("address", 4, "tcp://a:1", "has its own"),
        ("slurm", None, None, "needs --workers"),
    ],
)
def test_what_a_cluster_needs_is_asked_for(name: str, workers: int | None, address: str | None, message: str) -> None:
    with pytest.raises(UserError, match=message):
        executor(name, workers, address=address)
