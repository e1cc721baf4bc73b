"""Methods that take memory and processor time, by themselves or by other processes."""

import os
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

MIB, SECONDS = 96, 0.3
BURNER = "import time; x = bytearray(b'1') * {mib} * 2**20; print(1, flush=True)\nwhile {more}: pass"
BURNED = BURNER.format(mib=MIB, more=f"time.process_time() < {SECONDS}")
LASTING = f"{BURNED}\nprint(2, flush=True)\nwhile True: pass"


def burn():
    began = time.process_time()
    while time.process_time() - began < SECONDS:
        pass


@dataclass(frozen=True)
class Plain:
    def solve(self, target, bench):
        return target


class SetsPeakBack(Plain):
    def solve(self, target, bench):
        held = bytearray(b"1") * MIB * 2**20
        time.sleep(0.2)  # in which memory is looked at
        del held
        Path("/proc/self/clear_refs").write_text("5")
        return target


class HasItDone(Plain):
    """By a process that ends before it does."""

    def solve(self, target, bench):
        subprocess.run([sys.executable, "-c", BURNED], check=True)
        return target


class LeavesIt(Plain):
    """To a process of another session, which goes on and on."""

    def solve(self, target, bench):
        mine = [sys.executable, "-c", LASTING, os.fspath(Path.cwd())]
        told = subprocess.Popen(mine, start_new_session=True, stdout=subprocess.PIPE).stdout
        told.readline(), told.readline()
        return target
