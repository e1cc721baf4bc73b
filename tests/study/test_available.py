from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest
import torch

from holobench_eval.core.errors import UserError
from holobench_eval.study.config import load_study
from holobench_eval.study.plan import plan
from holobench_eval.study.run import Outcome
from tests.study.test_run import compute
from tests.support.fake_study import solves, write_config

pytestmark = pytest.mark.usefixtures("no_physics")

NEEDY = '''

from pathlib import Path


@dataclass(frozen=True)
class Needy(Toy):
    """Runs where a file says so."""

    def available(self):
        return None if Path(__file__).with_name("here").exists() else "no lens; buy one"
'''


def needy(tmp_path: Path) -> Callable[[], Outcome]:
    config = write_config(tmp_path, ("plugins.py:Toy", "plugins.py:Needy"))
    plugins = tmp_path / "plugins.py"
    plugins.write_text(plugins.read_text() + NEEDY)

    return partial(compute, config, tmp_path / "out")


def test_a_method_that_cannot_run_here_is_refused_before_anything_is_computed(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"^method 'plugins.py:Needy' cannot run here: no lens; buy one$"):
        needy(tmp_path)()
    assert solves(tmp_path) == []


def test_what_was_computed_needs_no_method_any_more(tmp_path: Path) -> None:
    run = needy(tmp_path)
    (tmp_path / "here").touch()
    run()
    (tmp_path / "here").unlink()
    run()
    assert len(solves(tmp_path)) == 6


@pytest.mark.parametrize("asked", ["protocol: {metrics: [psnr, lpips_alex]}", "headline: lpips_alex_srgb"])
def test_a_metric_without_its_weights_is_refused_by_a_run_and_not_by_reading_the_study(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, asked: str
) -> None:
    monkeypatch.setattr(torch.hub, "get_dir", lambda: str(tmp_path / "hub"))
    config = write_config(tmp_path)
    config.write_text(f"{config.read_text()}\n{asked}\n")
    assert plan(load_study(config)).metrics["lpips_alex"] == "v2, 0.1"  # as with the weights
    with pytest.raises(UserError, match="metric 'lpips_alex' cannot be computed here: no trunk weights"):
        compute(config, tmp_path / "out")
    assert not solves(tmp_path)
