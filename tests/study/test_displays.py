from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from holobench_eval import display
from holobench_eval.core.errors import CellError, UserError
from holobench_eval.study import displays
from holobench_eval.study.displays import condition, workbench

TEXT = Path(display.__file__).parent.joinpath("simulated", "profiles", "ideal.yaml").read_text()


class Uncalibrated:
    @property
    def registration(self) -> Any:
        raise CellError("no circles found")


def test_a_condition_tells_a_profile_at_the_panel_of_the_study(tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text(TEXT.replace("name: ideal", "name: mine"))
    shown = condition("mine.yaml", (128, 256), tmp_path)
    assert (shown.name, shown.version, shown.spec.shape) == ("mine", 1, (128, 256))
    assert condition("mine.yaml", None, tmp_path).spec.shape == (1080, 1920)


def test_a_profile_that_changes_under_a_run_is_refused(tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text(TEXT)
    shown = condition("mine.yaml", (128, 128), tmp_path)
    (tmp_path / "mine.yaml").write_text(f"{TEXT}# later\n")
    with pytest.raises(UserError, match="has changed since the study was planned"):
        workbench(shown, seed=0)


def test_a_failed_calibration_is_found_out_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "mine.yaml").write_text(TEXT)
    shown, opened = condition("mine.yaml", (128, 128), tmp_path), []

    def open_bench(*_: Any, **__: Any) -> Uncalibrated:
        opened.append(1)
        return Uncalibrated()

    monkeypatch.setattr(displays, "open_bench", open_bench)
    for _ in range(2):
        with pytest.raises(CellError, match="no circles found"):
            workbench(shown, seed=0)
    assert len(opened) == 1
