"""What a method takes in a process of its own is measured from outside, whatever the process does about it."""

import subprocess
import sys
from pathlib import Path

import psutil
import pytest

from holobench_eval.core.device import CPU
from holobench_eval.study import cost, isolation
from holobench_eval.study.isolation import process
from tests.support import plugins
from tests.support.patience import wait_until
from tests.support.plugins.burning import BURNER, MIB, SECONDS

pytestmark = pytest.mark.skipif(not Path("/proc/self/clear_refs").exists(), reason="memory is measured on Linux alone")


def taken_by(name: str, folder: Path, more: str = "") -> cost.Cost:
    """What a class of ``burning`` takes in its process; more: code that its file ends with."""
    (folder / "mine.py").write_text(plugins.text("burning") + more)
    method = isolation.build(f"mine.py:{name}", {}, folder)
    with isolation.opened(method, CPU) as ready:
        watch = cost.Stopwatch(CPU, ready.pid, ready.late)
        method.solve(None, None)
        return watch.stop()


def at_work(folder: Path) -> list[psutil.Process]:
    """Processes that were started with the name of a folder."""
    return [process for process in psutil.process_iter(["cmdline"]) if str(folder) in (process.info["cmdline"] or ())]


@pytest.fixture(autouse=True)
def in_the_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def test_a_method_that_does_nothing_takes_next_to_nothing(tmp_path):
    taken = taken_by("Plain", tmp_path)
    assert taken.cpu_s is not None
    assert taken.memory_mib is not None
    assert 0 < taken.cpu_s < 0.25
    assert taken.memory_mib < MIB / 2


@pytest.mark.parametrize("name", ["SetsPeakBack", "HasItDone", "LeavesIt"])
def test_memory_and_processor_time_are_those_of_all_its_processes_at_any_time(name, tmp_path):
    taken = taken_by(name, tmp_path)
    assert taken.memory_mib is not None
    assert MIB < taken.memory_mib < 2 * MIB
    assert taken.cpu_s is not None
    assert taken.cpu_s > 0.2 or name == "SetsPeakBack"  # which sleeps
    if name == "LeavesIt":
        # The process that forks the calls ends one before it begins another.
        isolation.build("mine.py:Plain", {}, tmp_path)
        assert not at_work(tmp_path)


IN_A_THREAD = "lambda: (threading.Thread(target=burn).start(), time.sleep(SECONDS))"
BY_ANOTHER = "lambda: subprocess.run([sys.executable, '-c', BURNED], stdout=subprocess.DEVNULL)"


WORKS_WHEN_TOLD = """
import threading

def work():
    while not Path("begin").exists():
        time.sleep(0.01)
    burn()
    Path("worked").touch()

os.register_at_fork(after_in_parent=lambda: threading.Thread(target=work).start())
"""


@pytest.mark.parametrize(
    "handler",
    [
        *(f"after_in_child={work}" for work in ("burn", "lambda: time.sleep(SECONDS)", IN_A_THREAD, BY_ANOTHER)),
        *(f"before={work}" for work in ("burn", BY_ANOTHER)),
    ],
)
def test_what_a_method_does_before_its_call_is_on_the_clock(handler, tmp_path, monkeypatch):
    monkeypatch.setattr(process, "usually", lambda device: 0.0)
    taken = taken_by("Plain", tmp_path, f"\nimport threading\nos.register_at_fork({handler})\n")
    assert taken.seconds > SECONDS
    if handler == "after_in_child=burn":
        assert taken.cpu_s is not None
        assert taken.cpu_s > SECONDS


def test_work_between_two_calls_is_on_the_clock_of_the_second(tmp_path):
    (tmp_path / "mine.py").write_text(plugins.text("burning") + WORKS_WHEN_TOLD)
    method = isolation.build("mine.py:Plain", {}, tmp_path)
    Path("begin").touch()
    wait_until(Path("worked").exists)
    with isolation.opened(method, CPU) as ready:
        assert ready.late > SECONDS


def test_processes_that_start_with_its_import_are_refused(tmp_path):
    start = f"\nsubprocess.Popen([sys.executable, '-c', {BURNER.format(mib=1, more=True)!r}, os.getcwd()])\n"
    with pytest.raises(Exception, match="starts processes while its file is imported; start them in solve or prepare"):
        taken_by("Plain", tmp_path, start)
    assert not at_work(tmp_path)


def test_of_this_process_all_its_processors_count():
    watch = cost.Stopwatch()
    subprocess.run([sys.executable, "-c", "import time\nwhile time.process_time() < 0.3: pass"], check=True)
    taken = watch.stop()
    assert taken.cpu_s is not None
    assert taken.cpu_s > 0.25
