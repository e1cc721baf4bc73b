"""What a session's patterns hold on a panel with a correction map and three lasers, here and where the folder goes."""

import json
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest

from holobench_eval.core.errors import UserError
from holobench_eval.lab.bench_file import load_bench_file
from holobench_eval.lab.session import read_manifest
from tests.lab.session.running import told
from tests.study.studies import write_study

BENCH = """\
name: corrected
version: 1
panel: {shape: [96, 96], pitch: 6.4e-6, wavelengths: [6.36e-7, 5.17e-7, 4.46e-7], distance: 0.009, bits: 8, pupil: 0.8}
"""
PHASE = "phase: {two_pi_level: [311, 256, 221], correction: {file: flat.bmp, two_pi_level: [205, 180, 150]}}\n"
FLAT = np.random.default_rng(0).integers(0, 256, (96, 96)).astype(np.uint8)


def exported(folder: Path, bench: str, session: str = "session") -> tuple[Path, str]:
    targets = "{dataset: charts, params: {names: [tv_lines]}}"
    config = write_study(folder / "study.yaml", "double_phase", display="{bench: bench.yaml}", targets=targets)
    (folder / "bench.yaml").write_text(bench)
    cv2.imwrite(str(folder / "flat.bmp"), FLAT)
    return folder / session, " ".join(told("export", config, folder / session))


def test_patterns_have_a_full_turn_for_each_laser_and_the_map_that_travels_with_them(tmp_path: Path) -> None:
    session, said = exported(tmp_path, BENCH + PHASE)
    assert "phase.two_pi_level: level 255 is the last; 18%, 0%, 0% of a turn" in said
    plain, said = exported(tmp_path, BENCH, "plain")
    assert "two_pi_level" not in said
    letters = {each.colour: each.file for each in read_manifest(session).patterns if each.role == "letter"}
    for channel, name in letters.items():
        levels, nominal = (cv2.imread(str(each / name), cv2.IMREAD_UNCHANGED) for each in (session, plain))
        full, of_map = (311, 256, 221)[channel], (205, 180, 150)[channel]
        apart = levels / full - FLAT / of_map - nominal / 256
        within = np.abs(apart - np.round(apart)) < (0.5 / full + 0.5 / 256) * 1.01
        assert within.mean() > (0.75 if channel == 0 else 0.999)
    moved = Path(shutil.move(session, tmp_path / "moved"))
    (tmp_path / "flat.bmp").unlink()
    manifest = read_manifest(moved)
    assert np.allclose(manifest.phase.of(1).turns, FLAT / 180)
    assert load_bench_file(moved / "bench.yaml").digest == manifest.bench_sha256
    cv2.imwrite(str(moved / "flat.bmp"), FLAT[::-1])
    assert load_bench_file(moved / "bench.yaml").digest != manifest.bench_sha256


@pytest.mark.parametrize(
    ("phase", "says"),
    [
        ("{two_pi_level: [311, 256]}", "bench.yaml:4:8: phase: two_pi_level: 2 levels for 3 colours"),
        ("{two_pi_level: [311, 0, 256]}", "bench.yaml:4:29: phase.two_pi_level[1]: 0 is no level of a full turn"),
        ("{two_pi_level: [2.1, 1.9, 1.7]}", "two_pi_level[0]: 2.1 is no level of a full turn; expected 8 to 65536"),
        ("{correction: {file: flat.bmp, two_pi_level: 8}}", "levels from 0 to 255, which are 32 turns; set correction"),
        ("{correction: {file: gone.bmp}}", "gone.bmp: no such file"),
        ("{correction: {file: ../up.bmp}}", "does not travel with a session; put it beside this file"),
    ],
)
def test_what_is_wrong_with_the_levels_of_a_bench_is_one_line(tmp_path: Path, phase: str, says: str) -> None:
    (tmp_path / "lab").mkdir()
    cv2.imwrite(str(tmp_path / "up.bmp"), FLAT)
    session, said = exported(tmp_path / "lab", f"{BENCH}phase: {phase}\n")
    assert says in said
    assert not session.exists()


def test_a_manifest_names_no_map_outside_its_folder(tmp_path: Path) -> None:
    session, _ = exported(tmp_path, BENCH + PHASE)
    content = json.loads((session / "manifest.json").read_text())
    content["phase"]["correction"]["file"] = str(tmp_path / "flat.bmp")
    (session / "manifest.json").write_text(json.dumps(content))
    with pytest.raises(UserError, match="leads out of the session folder"):
        read_manifest(session)
