"""The displays that the paper's could have been: draws, what figures leave of them, and the displays that are kept."""

import re
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import pandas as pd
import pytest
import yaml

from holobench_eval.core.errors import UserError
from holobench_eval.display import load_profile
from holobench_eval.display.simulated import origins
from holobench_eval.display.simulated import profile as profiles

FOLDER = Path(__file__).parents[2] / "reports"
FAMILY = origins.load_family("leto-2020")
spec = spec_from_file_location("draws", FOLDER / "family" / "draws.py")
assert spec is not None
assert spec.loader is not None
draws = module_from_spec(spec)
spec.loader.exec_module(draws)


def shipped() -> list[dict]:
    """The rows of the displays that ship, with what stands in the head of their files."""
    rows = []
    for name in profiles.names(family=True):
        text = (profiles.FAMILY / f"{name}.yaml").read_text()
        head = r"(?:Draw |double_phase |wirtinger |SSIM )([0-9.]+)(?= |,|\.\n)"
        number, *scores = map(float, re.findall(head, text))
        keys = [f"{label}.{metric}_linear" for label in FAMILY["figures"] for metric in ("psnr", "ssim")]
        row = draws.drawn(FAMILY, int(number)) | dict(zip(keys, scores, strict=True))
        rows.append({**row, "display": name, "text": re.sub(r"(?m)^#.*\n", "", text)})
    return rows


def test_the_displays_that_ship_are_draws_of_their_family_and_the_report_follows_from_them():
    rows, committed = shipped(), next(FOLDER.glob("**/draws.csv")).parent
    assert [draws.text_of(FAMILY, row, row["display"]) for row in rows] == [row["text"] for row in rows]
    outside = round(FAMILY["members"] * FAMILY["outside"]["share"])
    assert (len(rows), sum(row["outside"] for row in rows)) == (FAMILY["members"], outside)
    report = draws.report(FAMILY, pd.read_csv(committed / "draws.csv"), rows)
    assert report == (committed / "report.md").read_text()


def test_draws_lie_within_their_ranges_and_outside_effects_are_on_in_their_share():
    rows = pd.DataFrame([draws.drawn(FAMILY, index) for index in range(200)])
    assert {*rows["geometry"]} == {*range(len(FAMILY["geometries"]))}
    assert rows["outside"].mean() == pytest.approx(FAMILY["outside"]["share"], abs=0.1)
    for given in origins.parameters(FAMILY):
        assert rows[given["name"]].dropna().between(given["low"], given["high"]).all()
    assert draws.drawn(FAMILY, 7) == rows.iloc[7].dropna().to_dict()


@pytest.mark.slow
def test_a_few_draws_become_a_report_and_displays_and_are_resumed(tmp_path, monkeypatch, capsys):
    """On a small panel, with figures that half of its draws have."""
    small = {
        **FAMILY,
        "geometries": FAMILY["geometries"][:1],
        "panel": [128, 128],
        "targets": {"dataset": "dead_leaves", "params": {"count": 1, "seed": 1, "colours": "natural"}},
        "tolerance": {"psnr": 4.0, "ssim": 0.5},
        "members": 2,
        "outside": {**FAMILY["outside"], "share": 0.5},
    }
    ranges = tmp_path / "ranges"
    ranges.mkdir()
    (ranges / "small.yaml").write_text(yaml.safe_dump(small))
    monkeypatch.setattr(origins, "RANGES", ranges)
    monkeypatch.setattr(draws, "RANGES", ranges)
    monkeypatch.setattr(draws, "ProcessPoolExecutor", InProcess)
    folder = tmp_path / "draws"
    draws.computed("small", folder, 4, 1)
    with (folder / "draws.csv").open("a") as file:
        file.write("5,0,")  # killed as it wrote
    draws.main(6, folder, 1, "small")
    assert capsys.readouterr().out.endswith("2 of 2 draws\n")
    rows = pd.read_csv(folder / "draws.csv")
    assert [*rows["draw"]] == [*range(6)]
    kept = [load_profile(str(path)) for path in sorted((folder / "displays").glob("*.yaml"))]
    assert [profile.name for profile in kept] == ["small-01", "small-02"]
    assert sum(profile.flicker.ripple > 0 for profile in kept) == 1
    assert "small-02" in (folder / "report.md").read_text()
    assert (folder / "corner.png").stat().st_size > 10_000
    with pytest.raises(UserError, match="too few to keep 2"):
        draws.members("small", rows.head(1))
    monkeypatch.setattr(draws, "HARNESS", "another")
    with pytest.raises(UserError, match="by other code"):
        draws.computed("small", folder, 6, 1)


class InProcess:
    """A pool of this process."""

    def __init__(self, workers: int) -> None: ...
    def __enter__(self) -> "InProcess":
        return self

    def __exit__(self, *error: object) -> None: ...
    def map(self, function, jobs):
        return map(function, jobs)
