"""What was measured of a twin is said of that twin alone."""

from __future__ import annotations

from pathlib import Path

import pytest

from holobench_eval.core.errors import UserError
from holobench_eval.display import load_profile
from holobench_eval.display.simulated.trust import Trust

TRUST = (
    "twin: {of: leto-aged, photographs: 59, pictures: 8, gap: {wirtinger: 1.0}, light: [0.05], "
    "flattery: 3.2, flattery_error: 0.4}"
)


def test_a_display_that_is_like_a_twin_is_none(tmp_path: Path) -> None:
    (tmp_path / "lab.yaml").write_text(f"like: ideal\nname: lab\n{TRUST}\n")
    (tmp_path / "changed.yaml").write_text("like: lab.yaml\nname: changed\nflicker: {rms: 0.1}\n")
    assert "more than 3 dB" in load_profile("lab.yaml", tmp_path).twin.words
    assert load_profile("changed.yaml", tmp_path).twin == Trust()


@pytest.mark.parametrize(
    ("old", "new"), [("0.4", "-0.4"), ("59", "-1"), ("3.2", "many"), ("1.0", "1000"), ("0.05", "-1")]
)
def test_impossible_figures_are_refused_at_their_place(tmp_path: Path, old: str, new: str) -> None:
    (tmp_path / "lab.yaml").write_text(f"like: ideal\nname: lab\n{TRUST.replace(old, new)}\n")
    with pytest.raises(UserError, match=r"lab\.yaml:3:\d+: "):
        load_profile("lab.yaml", tmp_path)
