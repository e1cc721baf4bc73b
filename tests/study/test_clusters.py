"""Studies on Dask clusters: a scheduler that runs already, and jobs of a queue that starts them when it likes."""

from __future__ import annotations

import os
import stat
import sys
from pathlib import Path

import pytest
from fake_study import fake_work, write_config
from test_executors import compute, untimed

from holobench_eval.errors import UserError
from holobench_eval.study import run as running
from holobench_eval.study.clusters import Address, Slurm
from holobench_eval.study.executors import Serial, executor

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
    here = str(Path(__file__).parent)
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


def test_workers_with_several_threads_are_refused() -> None:
    from distributed import LocalCluster

    with (
        LocalCluster(n_workers=1, threads_per_worker=2, processes=False, dashboard_address=None) as cluster,
        pytest.raises(UserError, match="start workers with --nthreads 1"),
    ):
        _ = Address(cluster.scheduler_address).workers


def test_a_scheduler_that_does_not_answer_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("holobench_eval.study.clusters.ANSWER", 1.0)
    with pytest.raises(UserError, match="no Dask scheduler answers at 'tcp:") as caught:
        _ = Address("tcp://127.0.0.1:9").workers
    assert "\n" not in str(caught.value)


@pytest.mark.slow
@pytest.mark.usefixtures("no_physics", "importable")
def test_a_slurm_queue_gives_the_table_of_one_process(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("dask_jobqueue")
    import dask

    tools = tmp_path / "bin"
    tools.mkdir()
    for name, text in (("sbatch", SBATCH), ("scancel", SCANCEL)):
        tool = tools / name
        tool.write_text(text.format(python=sys.executable, log=str(tmp_path)))
        tool.chmod(tool.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setenv("PATH", f"{tools}{os.pathsep}{os.environ['PATH']}")
    config = write_config(tmp_path)
    serial = compute(config, tmp_path / "serial", Serial())
    monkeypatch.setattr(running, "step", fake_work)
    site = {"queue": "normal", "cores": 1, "memory": "2GB", "interface": None, "local-directory": str(tmp_path)}
    with dask.config.set({"jobqueue.slurm": {**dask.config.get("jobqueue.slurm", {}), **site}}):
        assert untimed(compute(config, tmp_path / "queued", Slurm(2))) == untimed(serial)
    script = (tmp_path / "jobs").read_text()
    assert script.count("#SBATCH -J") == 2
    assert "export OMP_NUM_THREADS=1" in script


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
