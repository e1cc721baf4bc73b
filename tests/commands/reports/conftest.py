"""A finished report, computed once without physics, that tests copy and spoil."""

import shutil

import pytest

from holobench_eval.report import build_report
from holobench_eval.study.config import load_study
from tests.study.studies import compute
from tests.support.studies.fake_study import installed, write_config


@pytest.fixture(scope="session")
def finished(tmp_path_factory):
    """A folder with a config, and its report in ``reports/study``."""
    folder = tmp_path_factory.mktemp("finished")
    config, report = write_config(folder, count=2), folder / "reports" / "study"
    with installed():
        outcome = compute(config, report)
        build_report(load_study(config), outcome.records, report, outcome.provenance)
    return folder


@pytest.fixture
def made(finished, tmp_path):
    """The report in a copy of that folder."""
    shutil.copytree(finished, tmp_path, dirs_exist_ok=True)
    return tmp_path / "reports" / "study"
