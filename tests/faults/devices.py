"""A panel and a camera that fail at a drawn moment: frames do not come, are old or too small, devices vanish."""

from collections.abc import Callable
from dataclasses import dataclass

from holobench_eval.imaging.convention import Levels
from holobench_eval.lab.devices import Counts, DeviceError
from tests.study.studies import exchanged
from tests.support.simulated_devices import BENCH, Scene, SimulatedCamera, SimulatedSlm, bench, connect

FRAMES = 70  # that the camera takes in a life without a fault, about
FOREVER = 10**9

STUDY = """title: faults of devices
display: {bench: bench.yaml}
targets: {dataset: photographs, params: {count: 2}}
protocol: {metrics: [psnr]}
methods:
  - double_phase
  - {name: wirtinger, params: {iterations: 5}}
  - {name: "mine.py:mine", captures: 3}
"""
QUICK = exchanged(
    BENCH,
    ("settle: 0.0", "settle: 0.0, exposure: 0.045"),  # else it waits for the panel to find exposures
    ("[6.36e-7, 5.17e-7, 4.46e-7]", "[5.17e-7]"),
)
GREEN = "like: leto-mild\nname: green\npanel: {wavelengths: [5.17e-7]}\n"  # faults meet each colour alike
FILES = {"study.yaml": STUDY, "bench.yaml": QUICK, "green.yaml": GREEN}
FILES["switch.py"] = "def switch(channel):\n    pass\n"


@dataclass(frozen=True)
class Fault:
    """kind: of `FAILING`, or "panel"; first: the frame, or the picture of the panel, that it begins with; times: how
    many it spoils."""

    kind: str
    first: int
    times: int

    def now(self, number: int) -> bool:
        """Whether it spoils the frame or picture of this number."""
        return self.first <= number < self.first + self.times


def _late(_: Counts, __: Counts) -> Counts:
    raise DeviceError("simulated camera: no frame within 1 s")


FAILING: dict[str, Callable[[Counts, Counts], Counts]] = {
    "late": _late,
    "old": lambda _, before: before,
    "small": lambda frame, _: frame[1:],
}


class FailingCamera(SimulatedCamera):
    """A camera with a fault."""

    fault = Fault("late", FOREVER, 0)
    before: Counts | None = None

    def expose(self, seconds: float) -> tuple[Counts, float]:
        """A frame, or what the fault makes of it and the one before."""
        frame, seconds = super().expose(seconds)
        if self.before is not None and self.fault.kind in FAILING and self.fault.now(self.frames):
            return FAILING[self.fault.kind](frame, self.before), seconds
        self.before = frame
        return frame, seconds


class FailingSlm(SimulatedSlm):
    """A panel with a fault."""

    fault = Fault("panel", FOREVER, 0)
    asked = 0

    def show(self, levels: Levels) -> None:
        """Show levels, unless the fault has come."""
        self.asked += 1
        if self.fault.kind == "panel" and self.fault.now(self.asked):
            raise DeviceError("simulated panel: not connected")
        super().show(levels)


def failing(fault: Fault | None) -> None:
    """Connect a bench, whose devices have the fault."""
    scene = Scene(bench("green.yaml"))
    slm, camera = FailingSlm(scene), FailingCamera(scene)
    if fault:
        slm.fault = camera.fault = fault
    connect(slm, camera)
