"""Studies on Dask clusters: a scheduler that runs already, and jobs of a queue that starts them when it likes."""

import os
import signal
import stat
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from holobench_eval.core.errors import UserError
from holobench_eval.study import store
from holobench_eval.study.executors import Serial, clusters
from holobench_eval.study.executors.clusters import Address, Slurm
from holobench_eval.study.running import run as running
from tests.study.executors.test_executors import compute, untimed
from tests.support.patience import PATIENCE
from tests.support.studies.fake_study import fake_work, write_config

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("no_physics")]
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


def test_workers_of_a_scheduler_elsewhere_give_the_table_of_one_process_where_the_run_reads(tmp_path, monkeypatch):
    from distributed import LocalCluster

    config = write_config(tmp_path)
    config.write_text(f"{config.read_text()}isolation: none\n")
    serial = compute(config, tmp_path / "serial", Serial())
    monkeypatch.setattr(running, "step", fake_work)
    here = str(Path(__file__).parents[3])  # where worker processes find the fake study
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([here, os.environ.get("PYTHONPATH", "")]))
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    with LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as cluster:
        monkeypatch.chdir(tmp_path)
        found = compute(Path(config.name), Path("out"), Address(cluster.scheduler_address))
    assert untimed(found) == untimed(serial)
    assert not list((tmp_path / "elsewhere").iterdir())


def test_a_worker_that_does_not_see_the_folder_says_so(tmp_path):
    with pytest.raises(UserError, match=r"does not see the folder .*gone"):
        clusters._at_home(str(tmp_path / "gone"), resources, 0)


def test_records_that_cannot_be_seen_end_the_run(tmp_path, monkeypatch):
    monkeypatch.setattr(store, "LATE", 0.0)

    class Elsewhere(Serial):
        def map(self, function: Any, jobs: Any) -> Any:
            for job in jobs:
                yield job, function(replace(job, setting=replace(job.setting, output=tmp_path / "other")))

    with pytest.raises(UserError, match=r"a worker has written a record that is not in .*out/records; workers have to"):
        compute(write_config(tmp_path), tmp_path / "out", Elsewhere())


SEEN = threading.Event()


def until_seen(_: object) -> None:
    SEEN.wait(PATIENCE)


@pytest.mark.parametrize("waiting", [False, True], ids=["with a job", "before its first job"])
def test_a_scheduler_that_goes_away_ends_the_run_in_one_line(monkeypatch, waiting):
    import dask
    from distributed import LocalCluster

    monkeypatch.setattr(clusters, "ANSWER", 0.5)
    SEEN.clear()
    with (
        dask.config.set({"distributed.comm.timeouts.connect": "0.5s"}),
        LocalCluster(n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None) as cluster,
    ):

        def jobs() -> Iterator[int]:
            close = partial(cluster.sync, cluster.scheduler.close)
            if waiting:
                close()
                time.sleep(0.5)  # until the client has seen it
            else:
                threading.Timer(0.3, close).start()
            yield 1

        with pytest.raises(UserError, match="the Dask scheduler went away; what is finished is kept"):
            list(Address(cluster.scheduler_address).map(until_seen, jobs()))
        SEEN.set()


def test_a_scheduler_that_does_not_answer_is_one_line(monkeypatch):
    monkeypatch.setattr("holobench_eval.study.executors.clusters.ANSWER", 1.0)
    with pytest.raises(UserError, match=r"^no Dask scheduler answers at 'tcp:.*$"):
        _ = Address("tcp://127.0.0.1:9").workers


def resources(_: int) -> dict[str, float]:
    """What the worker that computes this declares."""
    from distributed import get_worker

    return dict(get_worker().state.total_resources)


def test_on_a_gpu_every_job_goes_to_a_worker_that_declares_one_and_on_the_cpu_to_any():
    from distributed import Client, Scheduler, SpecCluster, Worker

    workers: dict[str, dict[str, Any]] = {
        name: {"cls": Worker, "options": {"nthreads": 1, "resources": declared}}
        for name, declared in (("plain", None), ("graphics", {"GPU": 1}))
    }
    scheduler = {"cls": Scheduler, "options": {"dashboard": False, "port": 0}}
    with SpecCluster(workers=workers, scheduler=scheduler, silence_logs=50) as cluster, Client(cluster) as client:
        client.wait_for_workers(2)
        for on_gpu, count, declared in ((True, 1, {1}), (False, 2, {0, 1})):
            chosen = Address(cluster.scheduler_address, on_gpu)
            assert chosen.workers == count
            assert {found.get("GPU", 0) for _, found in chosen.map(resources, range(6))} == declared


@pytest.mark.parametrize(
    ("threads", "on_gpu", "message"),
    [(2, False, "has several threads"), (1, True, "declares a GPU; start one with: dask worker {address} ")],
)
def test_a_scheduler_without_usable_workers_says_how_to_start_one(threads, on_gpu, message):
    from distributed import LocalCluster

    with LocalCluster(n_workers=1, threads_per_worker=threads, processes=False, dashboard_address=None) as cluster:
        address = cluster.scheduler_address
        with pytest.raises(UserError, match=message.format(address=address)):
            _ = Address(address, on_gpu).workers


@pytest.fixture
def queue(tmp_path, monkeypatch):
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


@pytest.mark.parametrize("on_gpu", [False, True])
def test_slurm_jobs_have_one_thread_declare_a_gpu_and_keep_the_sites_own_arguments(queue, on_gpu, monkeypatch):
    import dask

    for name in [name for name in sys.modules if name.startswith("dask_jobqueue")]:
        monkeypatch.delitem(sys.modules, name)  # imported here, as by a run
    signal.signal(signal.SIGINT, signal.default_int_handler)
    with dask.config.set({"jobqueue.slurm.worker-extra-args": ["--lifetime", "1h"]}):
        assert dict(Slurm(1 + on_gpu, on_gpu).map(abs, range(-3, 0))) == {-3: 3, -2: 2, -1: 1}  # on a GPU if asked for
    script = queue.read_text()
    assert script.count("#SBATCH -J") == 1 + on_gpu
    assert "export OMP_NUM_THREADS=1" in script
    assert ("--lifetime 1h --resources GPU=1" if on_gpu else "--lifetime 1h") in script
    assert ("--resources" in script) == on_gpu
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler  # Ctrl-C ends a run in order
