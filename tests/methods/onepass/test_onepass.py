"""One-pass networks: where they start, that they learn, on any size, and what their training costs in photographs."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import torch

from holobench_eval.core import plugins
from holobench_eval.display.api import DisplaySpec
from holobench_eval.display.nominal import ideal_image
from holobench_eval.methods.calibrated import patterns
from holobench_eval.methods.double_phase import AntiAliasedDoublePhase, DoublePhase
from holobench_eval.methods.learned.fidelity import matched_psnr
from holobench_eval.methods.losses import amplitude_l2
from holobench_eval.methods.onepass import training
from holobench_eval.methods.wirtinger import Wirtinger
from tests.study.test_identity import grid
from tests.support.small_training import Fate, Killed, Memory, pictures, quick, same, small_spec, solving_bench
from tests.support.small_training import training_bench as bench_of

NAMES = ("holonet", "ccnn", "tensor_holography", "unet_phase")
ODD = small_spec(65, 47, colours=2)
SHORT = {"training": {"rounds": 1, "images": 2, "steps": 3}, "patterns": 2}
networks = pytest.mark.parametrize("name", NAMES)


def untrained(method: Any, spec: DisplaySpec) -> dict[str, Any]:
    return {"network": method._fresh(bench_of(spec, Memory())).state_dict()}


def shown(method: Any, spec: DisplaySpec, learned: dict[str, Any] | None = None) -> tuple[float, float]:
    """PSNR [dB] and amplitude error of the ideal picture that a method makes of the first training image."""
    (target,) = pictures(spec)
    phase = method.solve(target[None], solving_bench(method, target, spec, learned or {}))[0]
    image = ideal_image(phase, spec)
    return matched_psnr(image, target), float(amplitude_l2(image, target).mean())


def test_before_it_has_learned_a_network_that_corrects_an_encoding_is_that_encoding() -> None:
    for name, baseline in {"holonet": DoublePhase(), "tensor_holography": AntiAliasedDoublePhase()}.items():
        method = plugins.build("methods", name, {})
        found, _ = shown(method, ODD, untrained(method, ODD))
        assert found == pytest.approx(shown(baseline, ODD)[0], abs=0.1)


@networks
def test_any_size_is_padded_and_comes_back(name: str) -> None:
    method = plugins.build("methods", name, {"width": 2})
    target = pictures(ODD, 2)
    phase = method.solve(target, solving_bench(method, target[0], ODD, untrained(method, ODD)))
    assert phase.shape == (2, 2, 65, 65)
    assert phase.isfinite().all()


@networks
def test_training_lowers_the_loss_without_a_photograph(name: str) -> None:
    spec = small_spec(48, 40)
    method = plugins.build("methods", name, {"steps": 40, "width": 4})
    bench = bench_of(spec, Memory(), images=1)
    learned = dict(method.prepare(bench))
    assert bench.captures == 0
    assert shown(method, spec, learned)[1] < 0.9 * shown(method, spec, untrained(method, spec))[1]


def test_a_network_through_a_calibrated_model_costs_the_photographs_of_its_calibration(monkeypatch) -> None:
    monkeypatch.setattr(patterns, "Wirtinger", lambda: Wirtinger(iterations=2))
    ideal, calibrated = (
        plugins.build("methods", "holonet", {"steps": 2, "width": 2, "through": through, "calibration": SHORT})
        for through in ("ideal", "parametric_model")
    )
    alone, bench = bench_of(ODD, Memory()), bench_of(ODD, Memory())
    calibrated.calibration.prepare(alone)
    learned = calibrated.prepare(bench)
    assert bench.captures == alone.captures > 0
    assert not same(learned, ideal.prepare(bench_of(ODD, Memory())))
    target = pictures(ODD)
    trained, moved = (replace(calibrated, offset=offset) for offset in ("none", "centre"))
    phases = [one.solve(target, solving_bench(one, target[0], ODD, learned)) for one in (trained, moved)]
    assert torch.equal(*phases)  # the phase that the model of the display was shown


def test_other_parameters_train_another_network(tmp_path: Path) -> None:
    rows = ("", "rate: 0.01", "steps: 5", "width: 9", "through: parametric_model", "calibration: {patterns: 3}")
    found = [
        preparation.id
        for row in rows
        for preparation in grid(tmp_path, "holonet", ("label: row", f"params: {{{row}}}")).preparations().values()
    ]
    assert len(set(found)) == len(rows)


def test_a_training_that_was_killed_ends_with_the_same_bits(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(training, "STEPS_BETWEEN_SAVES", 2)
    method, memory = quick("ccnn"), Memory(as_files=True)
    whole, moments = method.prepare(bench_of(ODD, memory)), memory.fate.passed
    memory = Memory(as_files=True)
    with pytest.raises(Killed):
        method.prepare(bench_of(ODD, memory, Fate(moments.index(f"after keeping {training.KEPT}"))))
    assert memory.kept[training.KEPT]["value"]["step"] == 2
    assert same(method.prepare(bench_of(ODD, memory)), whole)
