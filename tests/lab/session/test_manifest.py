"""A manifest may come from anywhere: what is not exactly ours is refused in one line, and no path in it is followed."""

import functools
import json
import operator
from dataclasses import replace

import pytest

from holobench_eval.core.errors import UserError
from holobench_eval.imaging.convention import Convention
from holobench_eval.lab.session.manifest import (
    Manifest,
    Pattern,
    capture_of,
    file_of,
    inside,
    read_manifest,
    refuse_links_out,
    write_manifest,
)

HEX = "ab" * 32
PATTERN = Pattern(1, 1, "hologram", 0, 1.0, HEX, HEX, file_of(1, 1), capture_of(1, 1))
MANIFEST = Manifest(1, HEX, HEX, HEX, "bench", (128, 160), (5.2e-7,), Convention(sign=-1), False, (PATTERN,))


def test_a_manifest_comes_back_as_it_was_written_with_its_rounds(tmp_path):
    second = replace(PATTERN, round=2, file=file_of(2, 1), capture=capture_of(2, 1))
    both = replace(MANIFEST, patterns=(PATTERN, second))
    write_manifest(tmp_path, both)
    assert read_manifest(tmp_path) == both
    assert (both.rounds, both.of_round(2)) == (2, [second])


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
    write_manifest(tmp_path, MANIFEST)
    content = json.loads((tmp_path / "manifest.json").read_text())
    functools.reduce(operator.getitem, keys[:-1], content)[keys[-1]] = value
    (tmp_path / "manifest.json").write_text(json.dumps(content))
    with pytest.raises(UserError, match=line) as caught:
        read_manifest(tmp_path)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 400 + len(str(tmp_path))


@pytest.mark.parametrize("text", ["", "[]", "{", "null", "[" * 100_000, '{"format": 1, "format": 1}', "\x00"])
def test_what_is_no_manifest_is_refused_in_one_line(tmp_path, text):
    (tmp_path / "manifest.json").write_text(text)
    with pytest.raises(UserError) as caught:
        read_manifest(tmp_path)
    assert "\n" not in str(caught.value)


def test_a_manifest_that_is_a_link_or_missing_is_refused(tmp_path):
    with pytest.raises(UserError, match="no such file"):
        read_manifest(tmp_path)
    write_manifest(tmp_path, MANIFEST)
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "manifest.json").symlink_to(tmp_path / "manifest.json")
    with pytest.raises(UserError, match="no such file"):
        read_manifest(tmp_path / "elsewhere")


def test_a_link_out_of_the_folder_is_refused(tmp_path):
    session = tmp_path / "session"
    (session / "captures").mkdir(parents=True)
    (session / "captures" / "0001.png").symlink_to(tmp_path / "secret.png")
    (session / "patterns").symlink_to(tmp_path)
    for name in ("captures/0001.png", "patterns/0001.png"):
        with pytest.raises(UserError, match="leads out of the session folder"):
            inside(session, name)


@pytest.mark.parametrize("name", ["report", "report/records", "captures", "study.yaml", "artifacts/one/learned.pt"])
def test_no_link_anywhere_in_a_session_leads_out_of_it(tmp_path, name):
    session, outside = tmp_path / "session", tmp_path / "outside"
    outside.mkdir()
    (session / name).parent.mkdir(parents=True)
    (session / name).symlink_to(outside)
    with pytest.raises(UserError, match="leads out of the session folder"):
        refuse_links_out(session)
    (session / name).unlink()
    (session / "inner").symlink_to(session)
    refuse_links_out(session)
