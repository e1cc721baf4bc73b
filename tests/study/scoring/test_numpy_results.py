"""A method may give NumPy's arrays: each scores to the last digit what the tensor of the same numbers scores."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from holobench_eval.display.phases import from_numpy
from tests.study.studies import write_study
from tests.support import plugins
from tests.support.studies.trained_study import compute

METHODS = plugins.text("arrays")

EXPECTED = "expected tensors, numbers, text, lists or mappings of them"
REFUSED = {
    "none": "{}: solve returned ndarray of uint8, not a phase (1, 3, H, W)",
    "files": f"what solve returned: a value is ndarray of uint8; {EXPECTED}",
}


def records(folder: Path, isolation: str, *methods: str, **entries: str) -> dict[str, dict[str, Any]]:
    """The records of a study by label; one with NumPy's arrays in it as one without."""
    folder.mkdir(exist_ok=True)
    (folder / "mine.py").write_text(METHODS)
    config = write_study(folder / "study.yaml", *methods, isolation=isolation, **entries)
    return {record["label"]: record for record in compute(config).records}


def named(label: str, name: str, params: str = "{}") -> str:
    return f'{{name: "mine.py:{name}", label: {label}, params: {params}}}'


@pytest.mark.parametrize("isolation", ["none", "files"])
def test_a_phase_scores_what_its_tensor_scores_and_levels_are_none(tmp_path, isolation):
    methods = [named("t", "Tensors"), named("a", "Arrays"), named("function", "array"), named("levels", "levels")]
    methods += [named(f"{name[0].lower()}64", name, "{double: true}") for name in ("Tensors", "Arrays")]
    found = records(tmp_path, isolation, *methods)
    levels = found.pop("levels")
    assert (levels["state"], levels["reason"]) == ("failed", REFUSED[isolation].format("levels"))
    assert {record["state"] for record in found.values()} == {"done"}, [r["reason"] for r in found.values()]
    assert found["t"]["scores"] == found["a"]["scores"] == found["function"]["scores"] != found["t64"]["scores"]
    assert found["t64"]["scores"] == found["a64"]["scores"]


@pytest.mark.parametrize("isolation", ["none", "files"])
def test_holograms_and_predictions_score_what_their_tensors_score(tmp_path, isolation):
    found = {}
    for shown in ("Tensors", "Arrays", "levels"):
        predicted, shown_by = (named("t", "Tensors"), named("a", "Arrays")), f"{{name: 'mine.py:{shown}'}}"
        methods = predicted if shown == "Tensors" else predicted[:1]
        found[shown] = records(tmp_path / shown, isolation, *methods, measure="prediction", holograms=shown_by)
    assert found["levels"]["t"]["reason"] == REFUSED[isolation].format("mine.py:levels")
    first, same, other = found["Tensors"]["t"], found["Tensors"]["a"], found["Arrays"]["t"]
    assert {record["state"] for record in (first, same, other)} == {"done"}
    assert first["scores"] == same["scores"] == other["scores"]


@pytest.mark.parametrize("dtype", ["<f4", ">f4", "<f8", ">f8"])
def test_real_numbers_become_a_tensor_of_its_own_memory(dtype):
    array = np.arange(24, dtype=dtype).reshape(2, 3, 4)[:, ::-1].transpose(2, 0, 1)
    array.flags.writeable = False
    tensor = from_numpy(array)
    assert tensor.dtype == (torch.float32 if dtype[1:] == "f4" else torch.float64)
    assert tensor.is_contiguous()
    assert np.array_equal(tensor.numpy(), array)
    assert not np.shares_memory(tensor.numpy(), array)


OTHER = [np.zeros(2, np.float16), np.zeros(2, np.complex64), np.zeros(2, np.uint8), np.ma.zeros(2), np.array([None])]


@pytest.mark.parametrize("value", [*OTHER, np.float32(1), torch.zeros(2), [1.0], None])
def test_all_else_stays_as_it_is(value):
    assert from_numpy(value) is value
