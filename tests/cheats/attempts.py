"""Methods that try to look better than they are, each in a few lines. Every one shows the phase zero, honestly or not.

``outcome`` is what has to come of it when the method runs in a process of its own: ``impossible`` (the cell is that of
the honest phase), ``refused`` (it fails, for ``reason``), ``trusted`` (nothing keeps a method from it, and
docs/start/trust.md says so). ``calls``: 2 for what one call could do to the next.
"""

import builtins
import copy
import ctypes
import dataclasses
import functools
import gc
import os
import pickle
import random
import resource
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np
import torch

SEEN = {}


@dataclass(frozen=True)
class Attempt:
    """Has no settings, and neither has what derives from it."""

    outcome: ClassVar[str] = "impossible"
    reason: ClassVar[str] = ""
    calls: ClassVar[int] = 1

    def __init_subclass__(cls, reason="", **known):
        for name, value in (known | ({"outcome": "refused", "reason": reason} if reason else {})).items():
            setattr(cls, name, value)

    def phase(self, target, bench):
        return torch.zeros((*target.shape[:2], *bench.spec.shape))

    def solve(self, target, bench):
        self.cheat(target, bench)
        return self.phase(target, bench)

    def cheat(self, target, bench): ...


class Honest(Attempt): ...


class Beside(Attempt): ...


# --- reads the bench


class ReadsTheBench(Attempt): ...


class AsksForTheSimulation(ReadsTheBench, reason="privileged = True"):
    def cheat(self, target, bench):
        bench.simulation.expected(self.phase(target, bench)[0], target[0])


class AsksForOtherHolograms(ReadsTheBench, reason="privileged = True"):
    def cheat(self, target, bench):
        return bench.starts


class ReadsPrivateNames(ReadsTheBench, reason="_display"):
    def cheat(self, target, bench):
        return bench._display.bench.profile


class ImportsTheBench(ReadsTheBench, reason="not for methods"):
    def cheat(self, target, bench):
        from holobench_eval.display.simulated.profile import load_profile

        load_profile(bench.spec.name)


class ImportsTheBenchByItsShortName(ReadsTheBench, reason="ImportError"):
    def cheat(self, target, bench):
        from holobench_eval.display import load_profile

        load_profile(bench.spec.name)


class ImportsTheHarness(ReadsTheBench, reason="not for methods"):
    def cheat(self, target, bench):
        from holobench_eval.study.opening import open_bench

        open_bench(bench.spec.name, bench.spec.shape, seed=0)


class SearchesTheMemory(ReadsTheBench):
    def cheat(self, target, bench):
        found = [thing for thing in gc.get_objects() if type(thing).__name__ in ("CalibratedBench", "SimulatedBench")]
        assert not found


class WalksTheStack(ReadsTheBench):
    def cheat(self, target, bench):
        frame = sys._getframe()
        while frame is not None:
            assert not {"display_bench", "job"} & set(frame.f_locals)
            frame = frame.f_back


class FollowsTheGradientOfACapture(ReadsTheBench, reason="does not require grad", camera=True):
    def cheat(self, target, bench):
        phase = self.phase(target, bench)[0].requires_grad_()
        bench.capture(phase).linear().sum().backward()


class RequestsTheSimulation(ReadsTheBench, reason="there is no 'simulation' here"):
    def cheat(self, target, bench):
        bench._ask("simulation")


class RequestsTheDisplay(ReadsTheBench, reason="there is no '_display' here"):
    def cheat(self, target, bench):
        bench._ask("_display")


# --- patches the harness


class PatchesTheHarness(Attempt): ...


class PatchesTheMatch(PatchesTheHarness):
    def cheat(self, target, bench):
        from holobench_eval.metrics import protocol

        protocol.match = lambda image, target, *more: (target, torch.ones(3))


class MutesTheNoise(PatchesTheHarness):
    def cheat(self, target, bench):
        torch.randn = torch.normal = lambda *shape, **named: torch.zeros(shape)


class SetsADefaultDevice(PatchesTheHarness):
    def cheat(self, target, bench):
        torch.set_default_device("meta")

    def phase(self, target, bench):
        return torch.zeros((*target.shape[:2], *bench.spec.shape), device="cpu")


class SetsDoublePrecision(PatchesTheHarness):
    def solve(self, target, bench):
        phase = self.phase(target, bench)
        torch.set_default_dtype(torch.float64)
        return phase


class PatchesTheTransform(PatchesTheHarness):
    def cheat(self, target, bench):
        torch.fft.fft2 = torch.fft.ifft2 = lambda field, *more, **named: field


class PatchesFiles(PatchesTheHarness):
    def cheat(self, target, bench):
        os.replace = os.fsync = builtins.open = Path.write_bytes = lambda *all, **named: None


class PatchesTheAccount(PatchesTheHarness):
    def cheat(self, target, bench):
        from holobench_eval.display.account import Account

        Account.take = lambda self: None


class SwitchesGradientsOff(PatchesTheHarness):
    def cheat(self, target, bench):
        torch.set_grad_enabled(False)
        torch.set_num_threads(1)
        torch.use_deterministic_algorithms(False)


class ChangesTheEnvironment(PatchesTheHarness):
    def cheat(self, target, bench):
        os.environ.update(XDG_CACHE_HOME="/nowhere", OMP_NUM_THREADS="64", HOME="/nowhere")
        os.chdir("/")


# --- exceeds the budget


class Photographer(Attempt, camera=True):
    def photographed(self, phase, handles):
        """Captures taken before every handle refuses."""
        taken = 0
        for handle in handles:
            with suppress(Exception):
                handle.capture(phase)
                taken += 1
        assert taken <= 2, taken


class CopiesTheHandle(Photographer):
    def cheat(self, target, bench):
        self.photographed(self.phase(target, bench)[0], [copy.copy(bench) for _ in range(20)])


class MakesAnotherHandle(Photographer):
    def cheat(self, target, bench):
        known = {"spec": bench.spec, "budget": None, "_label": "", "_target": target, "_learned": None}
        known |= {"target_name": "", "target_sha256": ""}
        handles = [type(bench)(bench._channel, known) for _ in range(20)]
        self.photographed(self.phase(target, bench)[0], handles)


class PhotographsInThreads(Photographer):
    def cheat(self, target, bench):
        phase, taken = self.phase(target, bench)[0], []

        def capture():
            try:
                taken.append(bench.capture(phase))
            except Exception:
                return

        threads = [threading.Thread(target=capture) for _ in range(12)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert len(taken) <= 2


class IgnoresTheEnd(Photographer):
    def cheat(self, target, bench):
        self.photographed(self.phase(target, bench)[0], [bench] * 30)


class PhotographsMoreThanOne(Photographer):
    """In one request."""

    def cheat(self, target, bench):
        self.photographed(self.phase(target, bench).expand(64, -1, -1, -1), [bench])


class PhotographsAfterItsAnswer(Photographer, calls=2):
    def cheat(self, target, bench):
        bench._channel.send({"result": self.phase(target, bench), "seen": {}})
        self.photographed(self.phase(target, bench)[0], [bench] * 20)


class RectifiesAForgedFrame(Photographer, reason="as capture returned it"):
    """Which would show where the camera stands, without a capture."""

    def cheat(self, target, bench):
        capture = bench.capture(self.phase(target, bench)[0])
        bench.rectify(dataclasses.replace(capture, frame=torch.eye(*capture.frame.shape[1:]).expand_as(capture.frame)))


class RaisesItsBudget(Photographer):
    def cheat(self, target, bench):
        bench.budget = 10**6
        self.photographed(self.phase(target, bench)[0], [bench] * 10)


class PhotographsWithoutACamera(Attempt, reason="declares no camera"):
    def cheat(self, target, bench):
        bench.capture(self.phase(target, bench)[0])


# --- lies about time


class LiesAboutTime(Attempt): ...


@dataclass(frozen=True)
class WorksBeforeItIsAsked(LiesAboutTime, slow=True):
    def __post_init__(self):
        time.sleep(0.4)


@functools.cache
def work_at_forks():
    os.register_at_fork(after_in_child=lambda: [None for _ in iter(lambda: time.process_time() < 0.45, False)])


class AtForks:
    """Has the process that imports a class work in every fork, once it is asked for what the class declares."""

    def __get__(self, instance, owner):
        if __name__ != "tests.cheats.attempts":
            work_at_forks()
        raise AttributeError


class WorksBeforeItIsReady(LiesAboutTime, slow=True, cpu=0.4):
    tuned = AtForks()


class StopsTheClock(LiesAboutTime, slow=True):
    def cheat(self, target, bench):
        time.perf_counter = time.monotonic = time.time = lambda: 0.0
        time.sleep(0.4)


class ReturnsAPromise(LiesAboutTime, reason="a value is function"):
    def phase(self, target, bench):
        return lambda: torch.zeros((*target.shape[:2], *bench.spec.shape))


class FinishesInAThread(LiesAboutTime):
    def phase(self, target, bench):
        phase = super().phase(target, bench)
        threading.Thread(target=lambda: (time.sleep(0.3), phase.fill_(1.0)), daemon=True).start()
        return phase


class FinishesInAnotherProcess(LiesAboutTime):
    """In memory that both share."""

    def phase(self, target, bench):
        phase = super().phase(target, bench).share_memory_()
        if os.fork() == 0:
            time.sleep(0.3)
            phase.fill_(1.0)
            os._exit(0)
        return phase


class AnswersTwice(LiesAboutTime, calls=2):
    """The second answer is the better one, and outside the clock."""

    def cheat(self, target, bench):
        bench._channel.send({"result": self.phase(target, bench), "seen": {}})
        time.sleep(0.3)


class SetsItsPeakBack(LiesAboutTime, mib=150):
    def cheat(self, target, bench):
        held = bytearray(b"1") * self.mib * 2**20
        time.sleep(0.3)
        del held
        with suppress(OSError):
            Path("/proc/self/clear_refs").write_text("5")


BURNS = """import time
held = bytearray(b'1') * 150 * 2**20
while time.process_time() < 0.4: pass
print(1, flush=True)
while {more}: pass"""


class HasAnotherWork(LiesAboutTime, mib=150, cpu=0.4):
    def cheat(self, target, bench):
        subprocess.run([sys.executable, "-c", BURNS.format(more=False)], stdout=subprocess.DEVNULL, check=True)


class LeavesAnotherAtWork(LiesAboutTime, mib=150, cpu=0.3):
    """Of a session of its own, so that it might go on beside the methods that are timed after it."""

    def cheat(self, target, bench):
        command = [sys.executable, "-c", BURNS.format(more=True)]
        left = subprocess.Popen(command, stdout=subprocess.PIPE, start_new_session=True)
        left.stdout.readline()


class LeavesAnOrphanAtWork(LiesAboutTime, cpu=0.3):
    """Whose parent has ended, so that no tree of processes has it below this one."""

    def cheat(self, target, bench):
        ready, told = os.pipe()
        if (child := os.fork()) == 0:
            os.setsid()
            if os.fork() == 0:
                while time.process_time() < 0.4:
                    pass
                os.write(told, b"1")
                while True:
                    pass
            os._exit(0)
        os.waitpid(child, 0)
        os.read(ready, 1)


# --- reaches the process that scores


def outside():
    """Numbers of processes that are neither this one nor its own: by the pipes' other ends, ancestors, and /proc."""
    numbers = {os.getppid()}
    for number in range(3, 256):
        with suppress(OSError), socket.socket(fileno=os.dup(number)) as end:
            numbers.add(struct.unpack("3i", end.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, 12))[0])
    for folder in Path("/proc").iterdir():
        if folder.name.isdigit():
            with suppress(OSError):
                command = (folder / "cmdline").read_bytes()
                numbers |= {int(folder.name)} if b"python" in command or b"holoeval" in command else set()
    return numbers - {0, os.getpid()}


class Reaching(Attempt):
    """Only from a namespace of its own, whose first process has forked it: without one it would really reach others."""

    def solve(self, target, bench):
        return super().solve(target, bench) if os.getppid() == 1 else self.phase(target, bench)

    def cheat(self, target, bench):
        for number in outside():
            with suppress(OSError):
                self.reach(number, target)


class StopsTheScorer(Reaching):
    def reach(self, number, target):
        os.kill(number, signal.SIGSTOP)


class InterruptsTheScorer(Reaching):
    def reach(self, number, target):
        os.kill(number, signal.SIGINT)


class KillsTheScorer(Reaching):
    def reach(self, number, target):
        os.kill(number, signal.SIGKILL)


class StopsAllThereIs(Reaching):
    def reach(self, number, target):
        os.kill(-1, signal.SIGSTOP)


class StopsTheGroupOfTheScorer(Reaching):
    def reach(self, number, target):
        if (group := os.getpgid(number)) > 1:
            os.killpg(group, signal.SIGSTOP)


class ReachingFurther(Reaching):
    def cheat(self, target, bench):
        for number in outside() - {os.getppid()}:
            with suppress(OSError):
                self.reach(number, target)


class WritesIntoTheScorer(ReachingFurther):
    """Zeros in the place of its target, wherever that lies in memory."""

    def reach(self, number, target):
        sought = target[0, 0, 0, :16].contiguous().numpy().tobytes()
        with Path(f"/proc/{number}/mem").open("r+b", buffering=0) as memory:
            for line in Path(f"/proc/{number}/maps").read_text().splitlines():
                first, last = (int(part, 16) for part in line.split()[0].split("-"))
                if "rw" in line.split()[1] and last - first < 2**28:
                    with suppress(OSError, OverflowError):
                        memory.seek(first)
                        if (place := memory.read(last - first).find(sought)) >= 0:
                            memory.seek(first + place)
                            memory.write(bytes(len(sought)))


class AttachesToTheScorer(ReachingFurther):
    def reach(self, number, target):
        assert ctypes.CDLL(None).ptrace(16, number, None, None) == -1


class BaresTheProcessesOfAll(ReachingFurther):
    """By taking away the /proc of its own namespace, which covers that of all; from a namespace below it may do all."""

    def cheat(self, target, bench):
        libc = ctypes.CDLL(None)
        libc.unshare(0x10000000 | 0x20000)  # CLONE_NEWUSER, CLONE_NEWNS
        while not libc.umount2(b"/proc", 2):  # MNT_DETACH
            pass
        super().cheat(target, bench)

    def reach(self, number, target):
        file = Path(f"/proc/{number}/oom_score_adj")
        file.write_text(file.read_text())
        Path(f"/proc/{number}/clear_refs").write_text("1")
        raise AssertionError(f"process {number} can be written to")


class StopsTheScorerFromAnotherProgram(Reaching):
    def cheat(self, target, bench):
        with suppress(OSError):
            subprocess.run(["pkill", "-STOP", "-f", "pytest|holoeval"], check=False)


class LimitsTheScorer(ReachingFurther):
    def reach(self, number, target):
        resource.prlimit(number, resource.RLIMIT_CPU, (1, 1))


class SlowsTheScorer(ReachingFurther):
    def reach(self, number, target):
        os.sched_setaffinity(number, {0})
        os.setpriority(os.PRIO_PROCESS, number, 19)


# --- keeps state


class KeepsState(Attempt, calls=2): ...


class CountsItsCalls(KeepsState):
    seen: ClassVar[list] = []

    def phase(self, target, bench):
        self.seen.append(1)
        return super().phase(target, bench) + len(self.seen) - 1


class RemembersInAnotherModule(KeepsState):
    def phase(self, target, bench):
        torch.calls_of_a_method = getattr(torch, "calls_of_a_method", -1) + 1
        return super().phase(target, bench) + torch.calls_of_a_method


class RemembersTargets(KeepsState):
    def phase(self, target, bench):
        SEEN[float(target.sum())] = target
        return super().phase(target, bench) + len(SEEN) - 1


class DrawsUnseeded(KeepsState):
    def phase(self, target, bench):
        draws = SEEN.setdefault("draws", [])
        draws.append((random.random(), float(np.random.rand()), float(torch.rand(()))))  # noqa: NPY002
        return super().phase(target, bench)


# --- poisons caches or records


class Dressed(torch.Tensor):
    """Answers every operation with what suits it."""

    @classmethod
    def __torch_function__(cls, function, types, args=(), kwargs=None):
        return torch.ones(3, 128, 128)


class PoisonsRecords(Attempt): ...


class ReturnsADressedTensor(PoisonsRecords, reason="a value is Dressed"):
    def phase(self, target, bench):
        return torch.zeros((*target.shape[:2], *bench.spec.shape)).as_subclass(Dressed)


class ReturnsNotANumber(PoisonsRecords, reason="NaN or infinite"):
    def phase(self, target, bench):
        return super().phase(target, bench) * float("nan")


class ReturnsTooMuch(PoisonsRecords, reason="not a phase"):
    def phase(self, target, bench):
        return torch.zeros((64, *target.shape[1:]))


class WritesToItsTarget(PoisonsRecords):
    def cheat(self, target, bench):
        target.zero_()


class SendsItsOwnResult(PoisonsRecords, calls=2, reason="returned dict, not a phase"):
    def cheat(self, target, bench):
        bench._channel.send({"result": {"psnr_linear": 100.0}, "seen": {}})


class FloodsTheTerminal(PoisonsRecords):
    def cheat(self, target, bench):
        for stream in (1, 2):
            os.write(stream, b"\x1b[2J\x1b]0;better\x07\r" * 2**10)


class SendsAPickle(PoisonsRecords, calls=2, reason="no answer"):
    def cheat(self, target, bench):
        bench._channel.connection.send_bytes(pickle.dumps(os.getcwd))


class SendsBrackets(PoisonsRecords, reason="no answer"):
    def cheat(self, target, bench):
        bench._channel.connection.send_bytes(b"[" * 200_000)


class ClaimsAHugeTensor(PoisonsRecords, reason="no answer"):
    def cheat(self, target, bench):
        bench._channel.connection.send_bytes(b'["tensor", "float32", [1000000, 1000000]]')


# --- ends the process


class Ender(Attempt, outcome="refused"): ...


class Exits(Ender, reason="exit code 0"):
    def cheat(self, target, bench):
        os._exit(0)


class Aborts(Ender, reason="SIGABRT"):
    def cheat(self, target, bench):
        os.abort()


class ReadsNowhere(Ender, reason="SIGSEGV"):
    def cheat(self, target, bench):
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        ctypes.string_at(0)


class Interrupts(Ender, reason="KeyboardInterrupt"):
    def cheat(self, target, bench):
        raise KeyboardInterrupt


class LeavesPython(Ender, reason="SystemExit"):
    def cheat(self, target, bench):
        sys.exit(0)


class ClaimsToWait(Ender, reason="Pending"):
    def cheat(self, target, bench):
        from holobench_eval.core.errors import Pending

        raise Pending


class ClaimsThatTheDiskIsFull(Ender, reason="StorageError"):
    def cheat(self, target, bench):
        from holobench_eval.core.errors import StorageError

        raise StorageError("the disk is full")


class KillsItsParent(Attempt, calls=2):
    def cheat(self, target, bench):
        os.kill(os.getppid(), signal.SIGKILL)


class ClosesEverything(Ender, calls=2, reason="process of the method"):
    def cheat(self, target, bench):
        os.closerange(3, 256)


class RunsForEver(Ender, reason="took more than"):
    def cheat(self, target, bench):
        while True:
            time.sleep(1)


class ForbidsItsEnd(Ender, reason="took more than"):
    def cheat(self, target, bench):
        signal.pthread_sigmask(signal.SIG_BLOCK, range(1, signal.NSIG))
        while True:
            with suppress(BaseException):
                time.sleep(1)


class AnswersWithoutAnEnd(Ender, reason="took more than"):
    """A message of a million bytes, of which few come."""

    def cheat(self, target, bench):
        os.write(bench._channel.connection.fileno(), struct.pack("!i", 10**6) + b"[")
        time.sleep(3600)


class StopsItself(Ender, reason="took more than"):
    def cheat(self, target, bench):
        os.kill(os.getpid(), signal.SIGSTOP)


class TakesAllMemory(Ender, reason="memory"):
    def cheat(self, target, bench):
        return [torch.ones(2**26) for _ in range(64)]


# --- exploits the noise's seed


class ForeseesTheNoise(Attempt, reason="_names"):
    def cheat(self, target, bench):
        from holobench_eval.core.seeds import generator

        return torch.randn(4, generator=generator("bench noise", *bench._names))


class AsksForTheSeed(Attempt, reason="seed"):
    def cheat(self, target, bench):
        return bench._ask("seed")


# --- trains on the target


class Trained(Attempt, reason="no image it may be trained with"):
    trains: ClassVar[bool] = True

    def prepare(self, bench):
        phase = torch.zeros((len(bench.spec.wavelengths), *bench.spec.shape))
        return {"seen": bench.photograph(phase, self.image(bench), "capture")}


class PhotographsATarget(Trained):
    def image(self, bench):
        from holobench_eval.datasets.photographs import Photographs
        from holobench_eval.display.training import TrainingImage

        return TrainingImage("astronaut", Photographs(count=1).load("astronaut", bench.spec.region.shape))


class RenamesATarget(Trained):
    def image(self, bench):
        from dataclasses import replace

        return replace(bench.images[0], target=bench.images[0].target.flip(-1))


class WritesToATrainingImage(Trained):
    def image(self, bench):
        bench.images[0].target.mul_(torch.linspace(0, 1, bench.images[0].target.shape[-1]))
        return bench.images[0]


class PhotographsATargetsHologram(Trained, outcome="trusted"):
    """Under an even gray, which any training may show: what a phase would show is not looked at."""

    def prepare(self, bench):
        from holobench_eval.datasets.photographs import Photographs
        from holobench_eval.display.training import TrainingImage
        from holobench_eval.methods.double_phase import DoublePhase

        target = Photographs(count=1).load("astronaut", bench.spec.region.shape, channels=len(bench.spec.wavelengths))
        phase = bench.solved(DoublePhase(), TrainingImage("astronaut", target))
        return {"seen": bench.photograph(phase, TrainingImage("gray", torch.full_like(target, 0.5)), "capture")}


class TrainsBeyondItsBudget(Trained, reason="capture"):
    def prepare(self, bench):
        for number in range(100):
            super().prepare(bench) if number else copy.copy(bench)
        return {}

    def image(self, bench):
        return bench.images[0]


# --- what a process of its own does not prevent


class Trusted(Attempt, outcome="trusted"): ...


class KeepsAFile(Trusted, calls=2):
    def cheat(self, target, bench):
        file = Path(__file__).with_name("kept.bin")
        seen = file.read_bytes() if file.exists() else b""
        file.write_bytes(seen + bytes([len(seen)]))


class StartsAnotherPython(Trusted):
    def cheat(self, target, bench):
        found = "import importlib.util as u; print(u.find_spec('holobench_eval').origin)"
        assert subprocess.run([sys.executable, "-c", found], capture_output=True, check=True).stdout


class KnowsThePhotographs(Trusted):
    def cheat(self, target, bench):
        from skimage import data

        assert data.astronaut().shape == (512, 512, 3)
