"""Numbers change with their declared version alone; what each case is lies in ``outputs.py``."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import torch

from holobench_eval.core import plugins
from holobench_eval.display.api import DisplaySpec
from holobench_eval.display.simulated.stages.sensor import Sensor
from holobench_eval.display.training import TrainingBench
from holobench_eval.imaging import align as aligning
from holobench_eval.methods import descent
from holobench_eval.methods.onepass import training
from holobench_eval.metrics import protocol
from tests.golden import outputs
from tests.golden.outputs import FILE, PICTURES, SETTINGS, cases, complaint, recorded, share

CASES = cases()


@pytest.mark.parametrize("name", CASES)
def test_the_numbers_are_those_of_the_declared_version(name: str) -> None:
    numbers, entry = CASES[name].numbers(), recorded().get(name)
    problem = complaint(name, CASES[name], numbers, entry)
    assert problem is None, problem
    assert entry is not None
    for part in numbers:  # told by how much, which `tests.processors` asks for
        assert share(CASES[name], numbers[part], entry["numbers"][part]) <= 1


def test_the_file_holds_what_ships_and_nothing_else() -> None:
    shipped = {f"method {name}" for name in plugins.names("methods")}
    known = {name for name in CASES if not name.startswith("method ")} | shipped
    assert recorded().keys() == known, f"run `python -m tests.golden.outputs`, which brings {FILE.name} up to date"


def _brighter_sensor(patch: pytest.MonkeyPatch) -> None:
    response = Sensor.response
    patch.setattr(Sensor, "response", lambda self, *given: 1.005 * response(self, *given))


def _other_encoding(patch: pytest.MonkeyPatch) -> None:
    encode = protocol._ENCODINGS["srgb"]
    patch.setitem(protocol._ENCODINGS, "srgb", lambda light: encode(light) ** 1.001)


def _another_place(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(aligning, "FINE", (512,))
    patch.setattr(aligning, "COARSE", (64,))


def _longer_wave(patch: pytest.MonkeyPatch) -> None:
    propagator = DisplaySpec.propagator

    def longer(self: DisplaySpec, *given: Any, **more: Any) -> Any:
        return propagator(replace(self, distance=1.005 * self.distance), *given, **more)

    patch.setattr(DisplaySpec, "propagator", longer)


def _brighter_training(patch: pytest.MonkeyPatch) -> None:
    photograph = TrainingBench.photograph
    patch.setattr(TrainingBench, "photograph", lambda self, *given: photograph(self, *given) + 0.01)


def _other_step(patch: pytest.MonkeyPatch) -> None:
    adam = torch.optim.Adam

    class Faster(adam):  # type: ignore[misc, valid-type]
        def __init__(self, params: Any, lr: float = 1e-3, **more: Any) -> None:
            super().__init__(params, lr=1.01 * lr, **more)

    patch.setattr(torch.optim, "Adam", Faster)
    begin = descent.Adam.__init__
    patch.setattr(descent.Adam, "__init__", lambda self, phase, rate: begin(self, phase, 1.01 * rate))
    later = descent.Adam.set_rate
    patch.setattr(descent.Adam, "set_rate", lambda self, rate: later(self, 1.01 * rate))
    decay = training.cosine_decay
    patch.setattr(training, "cosine_decay", lambda step, progress: 1.01 * decay(step, progress))


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("profile leto-aged", _brighter_sensor),
        ("metric psnr", _other_encoding),
        ("alignment", _another_place),
        ("method double_phase", _longer_wave),
        ("method wirtinger", _other_step),
        ("method hil", _brighter_training),
        ("method twin", _other_step),
        *((f"method {name}", _other_step) for name in sorted({*SETTINGS, *PICTURES}) if f"method {name}" in CASES),
    ],
)
def test_a_small_change_is_found(name, change: Callable[[pytest.MonkeyPatch], None], monkeypatch) -> None:
    change(monkeypatch)
    problem = complaint(name, CASES[name], CASES[name].numbers(), recorded()[name])
    for words in (f"numbers of '{name}' changed", "raise its declared version", "`python -m tests.golden.outputs`"):
        assert words in str(problem)


def test_a_new_version_and_a_new_method_must_be_written_and_what_is_not_finite_is_a_change() -> None:
    case, entry = CASES["method wirtinger"], recorded()["method wirtinger"]
    risen = complaint("method wirtinger", replace(case, version="Wirtinger 2"), entry["numbers"], entry)
    added = complaint("method wirtinger", case, entry["numbers"], None)
    broken = {name: [float("nan")] * len(values) for name, values in entry["numbers"].items()}
    assert "rewrites it" in str(risen)
    assert "is not in outputs.json" in str(added)
    assert "changed" in str(complaint("method wirtinger", case, broken, entry))


def test_the_file_is_rewritten_for_a_new_version_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    name, file = "method double_phase", tmp_path / FILE.name
    entry = recorded()[name]
    stale = {**entry, "numbers": {part: [2.0] * len(values) for part, values in entry["numbers"].items()}}
    file.write_text(json.dumps({name: stale}))
    monkeypatch.setattr(outputs, "FILE", file)
    for version, written in ((CASES[name].version, stale["numbers"]), ("DoublePhase 2", CASES[name].numbers())):
        case = replace(CASES[name], version=version)
        monkeypatch.setattr(outputs, "cases", lambda case=case: {name: case})
        assert outputs.main() == (version == CASES[name].version)
        assert json.loads(file.read_text())[name]["numbers"] == written
