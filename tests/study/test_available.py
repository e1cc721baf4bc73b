from __future__ import annotations

from pathlib import Path

import pytest
import torch

from holobench_eval.core.errors import UserError
from holobench_eval.study.config import load_study
from holobench_eval.study.plan import plan
from tests.study.studies import compute
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


def test_a_method_that_cannot_run_here_is_refused_before_anything_is_computed_unless_nothing_is_left_for_it(
    tmp_path: Path,
) -> None:
    config, here = write_config(tmp_path, ("plugins.py:Toy", "plugins.py:Needy")), tmp_path / "here"
    (tmp_path / "plugins.py").write_text((tmp_path / "plugins.py").read_text() + NEEDY)
    with pytest.raises(UserError, match=r"^method 'plugins.py:Needy' cannot run here: no lens; buy one$"):
        compute(config, tmp_path / "out")
    assert solves(tmp_path) == []
    here.touch()
    compute(config, tmp_path / "out")
    here.unlink()
    compute(config, tmp_path / "out")
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
