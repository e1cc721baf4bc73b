"""A file of another kind is named for what it is, not for its first key."""

from __future__ import annotations

import itertools
from pathlib import Path

import pytest

from holobench_eval.core.errors import UserError
from holobench_eval.core.schema import kinds_of
from holobench_eval.display import load_profile
from holobench_eval.display.simulated.profile import Profile
from holobench_eval.lab.bench_file import BenchFile, load_bench_file
from holobench_eval.study.config import load_study
from holobench_eval.study.definition import Study

READERS = {
    "a study": load_study,
    "a real bench": load_bench_file,
    "a simulated display": lambda path: load_profile(str(path)),
}
FILES = {
    "a study": "title: s\ntargets: {dataset: photographs}\nmethods: [wirtinger]\n",
    "a real bench": "name: b\nslm: {driver: monitor}\ncamera: {driver: files}\n",
    "a simulated display": "like: ideal\nname: d\nsensor: {bits: 12}\n",
}


@pytest.mark.parametrize(("given", "wanted"), list(itertools.permutations(READERS, 2)))
def test_a_file_of_another_kind_is_refused_for_its_kind(given: str, wanted: str, tmp_path: Path) -> None:
    path = tmp_path / "file.yaml"
    path.write_text(FILES[given])
    with pytest.raises(UserError, match=f"describes {given}; expected {wanted}"):
        READERS[wanted](path)


def test_each_kind_is_that_of_its_own_keys() -> None:
    for kind, cls in zip(READERS, (Study, BenchFile, Profile), strict=True):
        assert kinds_of(cls.__dataclass_fields__)[0] == kind
