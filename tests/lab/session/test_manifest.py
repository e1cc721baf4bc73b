"""A manifest may come from anywhere: what is not ours is refused, no path followed; patterns are for each laser."""

import functools
import json
import operator
import shutil
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from holobench_eval.core.errors import UserError
from holobench_eval.imaging.convention import Convention
from holobench_eval.lab.bench_file import load_bench_file
from holobench_eval.lab.session import manifest
from tests.lab.session.running import told
from tests.study.studies import write_study

HEX = "ab" * 32
PATTERN = manifest.Pattern(1, 1, "hologram", 0, 1.0, HEX, HEX, manifest.file_of(1, 1), manifest.capture_of(1, 1))
MANIFEST = manifest.Manifest(1, HEX, HEX, HEX, "bench", (128, 160), (5.2e-7,), Convention(sign=-1), False, (PATTERN,))


def test_a_manifest_comes_back_as_it_was_written_and_a_link_to_one_is_refused(tmp_path):
    second = replace(PATTERN, round=2, file=manifest.file_of(2, 1), capture=manifest.capture_of(2, 1))
    both = replace(MANIFEST, patterns=(PATTERN, second))
    with pytest.raises(UserError, match="no such file"):
        manifest.read_manifest(tmp_path)
    manifest.write_manifest(tmp_path, both)
    assert manifest.read_manifest(tmp_path) == both
    assert (both.rounds, both.of_round(2)) == (2, [second])
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "manifest.json").symlink_to(tmp_path / "manifest.json")
    with pytest.raises(UserError, match="no such file"):
        manifest.read_manifest(tmp_path / "elsewhere")


@pytest.mark.parametrize(
    ("keys", "value", "line"),
    [
        (("patterns", 0, "file"), "/etc/passwd", "should be 'patterns/round-1/0001.png'"),
        (("patterns", 0, "capture"), "../elsewhere/0001", "should be 'captures/round-1/0001'"),
        (("patterns", 0, "number"), 2, "stands after"),
        (("patterns", 0, "round"), 10**9, "less than or equal"),
        (("patterns", 0, "exposure"), float("nan"), "NaN"),
        (("patterns", 0, "exposure"), 1e300, "less than"),
        (("patterns", 0, "role"), "script", "hologram"),
        (("patterns", 0, "key"), "x", "at least 64"),
        (("patterns",), {"a": 1}, "unknown key 'a' in patterns"),
        (("paterns",), [], "unknown key 'paterns' in the document; did you mean 'patterns'"),
        (("photographed",), {"a\nb" * 10**5: 1}, "photographed.a\\\\nb"),
        (("panel",), [10**9, 10**9], "less than or equal"),
        (("panel",), [128], "panel has too few values: .128."),
        (("wavelengths",), [], "at least 1"),
        (("phase", "two_pi_level"), 0, "0 is no level of a full turn"),
        (("format",), 2, "format"),
        (("session",), None, "valid string"),
        (("display",), "x" * 10**6, "at most 200"),
    ],
)
def test_a_hostile_manifest_is_refused_in_one_line(tmp_path, keys, value, line):
    manifest.write_manifest(tmp_path, MANIFEST)
    content = json.loads((tmp_path / "manifest.json").read_text())
    functools.reduce(operator.getitem, keys[:-1], content)[keys[-1]] = value
    (tmp_path / "manifest.json").write_text(json.dumps(content))
    with pytest.raises(UserError, match=line) as caught:
        manifest.read_manifest(tmp_path)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 400 + len(str(tmp_path))


@pytest.mark.parametrize("text", ["", "[]", "{", "null", "[" * 100_000, '{"format": 1, "format": 1}', "\x00"])
def test_what_is_no_manifest_is_refused_in_one_line(tmp_path, text):
    (tmp_path / "manifest.json").write_text(text)
    with pytest.raises(UserError) as caught:
        manifest.read_manifest(tmp_path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["report", "report/records", "captures", "study.yaml", "artifacts/one/learned.pt"])
def test_no_link_anywhere_in_a_session_leads_out_of_it(tmp_path, name):
    session, outside = tmp_path / "session", tmp_path / "outside"
    outside.mkdir()
    (session / name).parent.mkdir(parents=True)
    (session / name).symlink_to(outside)
    for refuse in (manifest.refuse_links_out, lambda folder: manifest.inside(folder, f"{name}/0001.png")):
        with pytest.raises(UserError, match="leads out of the session folder"):
            refuse(session)
    (session / name).unlink()
    (session / "inner").symlink_to(session)
    manifest.refuse_links_out(session)


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
    letters = {each.colour: each.file for each in manifest.read_manifest(session).patterns if each.role == "letter"}
    for channel, name in letters.items():
        levels, nominal = (cv2.imread(str(each / name), cv2.IMREAD_UNCHANGED) for each in (session, plain))
        full, of_map = (311, 256, 221)[channel], (205, 180, 150)[channel]
        apart = levels / full - FLAT / of_map - nominal / 256
        within = np.abs(apart - np.round(apart)) < (0.5 / full + 0.5 / 256) * 1.01
        assert within.mean() > (0.75 if channel == 0 else 0.999)
    moved = Path(shutil.move(session, tmp_path / "moved"))
    (tmp_path / "flat.bmp").unlink()
    known = manifest.read_manifest(moved)
    assert np.allclose(known.phase.of(1).turns, FLAT / 180)
    assert load_bench_file(moved / "bench.yaml").digest == known.bench_sha256
    cv2.imwrite(str(moved / "flat.bmp"), FLAT[::-1])
    assert load_bench_file(moved / "bench.yaml").digest != known.bench_sha256


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
        manifest.read_manifest(session)
