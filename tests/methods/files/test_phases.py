"""A hologram from a file is the one that was written, whatever its form and convention, or is refused in one line."""

import math
import os
import re
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import tifffile
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image
from scipy.io import savemat
from torch import Tensor

from holobench_eval.core import plugins
from holobench_eval.core.errors import CellError, UserError
from holobench_eval.imaging.convention import Convention
from holobench_eval.methods.double_phase import encode
from holobench_eval.methods.files import arrays
from holobench_eval.methods.files.arrays import read_array
from tests.support.small_training import small_spec

SPEC = small_spec(12, 8, 3)
SHAPE = (3, *SPEC.shape)
LEVELS = np.random.default_rng(1).integers(0, 256, SHAPE).astype(np.uint8)
PHASE = LEVELS.astype(np.float64) * (math.tau / 256)


@dataclass
class Bench:
    target_name: str = "cat.jpg"
    spec = SPEC


def solved(file: Path, bench: Any = None, colours: int = 3, **params: Any) -> Tensor:
    method = plugins.build("methods", "phases", {"file": str(file), **params})
    phase: Tensor = method.solve(torch.zeros(1, colours, 8, 8), bench or Bench())
    return phase[0]


def turns_apart(phase: Tensor, wanted: Any) -> float:
    off = (phase.double() - torch.as_tensor(np.ascontiguousarray(wanted))) / math.tau
    return float((off - off.round()).abs().max())


def write_rgb(path: Path, levels: Any) -> None:
    assert cv2.imwrite(str(path), np.ascontiguousarray(np.moveaxis(levels, 0, -1)[..., ::-1]))


@pytest.mark.parametrize("last", [False, True])
def test_frames_are_read_as_one_hologram(tmp_path: Path, last: bool) -> None:
    frames = np.stack([PHASE, PHASE[::-1]])
    np.save(tmp_path / "frames.npy", np.moveaxis(frames, 1, -1) if last else frames)
    assert solved(tmp_path / "frames.npy").shape == (2, *SHAPE)
    assert turns_apart(solved(tmp_path / "frames.npy"), frames) < 1e-6


def test_frames_in_files_of_their_own_are_read_in_the_order_of_their_numbers(tmp_path: Path) -> None:
    file = tmp_path / "{stem}-frame-{frame}.png"
    for number, levels in enumerate((LEVELS, 255 - LEVELS), 1):
        write_rgb(tmp_path / f"cat-frame-{number}.png", levels)
    frames = np.stack([PHASE, (255 - LEVELS) * (math.tau / 256)])
    assert turns_apart(solved(file, frames=2), frames) < 1e-6
    with pytest.raises(CellError, match=r"cat-frame-3.png: no such file"):
        solved(file, frames=3)
    with pytest.raises(UserError, match=r"frames: '.*cat.png' is one file for all; name them by \{frame\}"):
        solved(tmp_path / "cat.png", frames=2)


@pytest.mark.parametrize("form", ["rgb.png", "rgb16.png", "rgb.tif", "npy", "last", "float", "npz", "mat", "channels"])
def test_every_form_of_file_gives_the_phase_that_was_written(tmp_path: Path, form: str) -> None:
    file, params = tmp_path / form, {}
    if form == "rgb16.png":
        write_rgb(file, LEVELS.astype(np.uint16) * 256)
    elif form.startswith("rgb"):
        write_rgb(file, LEVELS)
    elif form == "channels":
        for name, plane in zip(("r", "g", "b"), LEVELS, strict=True):
            cv2.imwrite(str(tmp_path / f"cat-{name}.png"), plane)
        file, params = tmp_path / "{stem}-{channel}.png", {"channels": ["r", "g", "b"]}
    elif form in ("npy", "last", "float"):
        file = tmp_path / f"{form}.npy"
        np.save(file, {"npy": LEVELS, "last": np.moveaxis(LEVELS, 0, -1), "float": PHASE}[form])
    else:
        file, params = tmp_path / f"many.{form}", {"variable": "phase"}
        write: Any = savemat if form == "mat" else lambda path, arrays: np.savez_compressed(path, **arrays)
        write(file, {"phase": PHASE, "other": np.zeros(3)})
    assert turns_apart(solved(file, **params), PHASE) < 1e-6


def test_radians_of_single_precision_arrive_to_the_last_bit(tmp_path: Path) -> None:
    phase = torch.from_numpy(PHASE.astype(np.float32)) * 3 - 9
    np.save(tmp_path / "cat.jpg.npy", phase.numpy())
    assert torch.equal(solved(tmp_path / "{target}.npy"), phase)


@settings(max_examples=40, deadline=None)
@given(
    convention=st.fixed_dictionaries(
        {
            "sign": st.sampled_from([1, -1]),
            "origin": st.floats(-7, 7),
            "two_pi_level": st.one_of(st.floats(8, 300), st.tuples(*3 * [st.floats(8, 300)])),
            "flip_horizontal": st.booleans(),
            "flip_vertical": st.booleans(),
            "order": st.sampled_from(["rgb", "bgr"]),
        }
    ),
    correction=st.one_of(st.none(), st.floats(25, 300), st.tuples(*3 * [st.floats(25, 300)])),
)
def test_the_convention_of_a_file_is_undone(
    tmp_path_factory: pytest.TempPathFactory, convention: dict[str, Any], correction: Any
) -> None:
    folder, params = tmp_path_factory.mktemp("convention"), {**convention, "levels": "all"}
    down, across = (-1 if convention[flip] else 1 for flip in ("flip_vertical", "flip_horizontal"))
    turns = (convention["sign"] * (PHASE - convention["origin"]) / math.tau)[:, ::down, ::across]
    if correction is not None:
        cv2.imwrite(str(folder / "flat.png"), LEVELS[0])
        turns = turns + LEVELS[0] / np.reshape(correction, (-1, 1, 1))
        params["correction"] = {"file": str(folder / "flat.png"), "two_pi_level": correction}
    levels = turns * np.reshape(convention["two_pi_level"], (-1, 1, 1))
    np.save(folder / "levels.npy", levels if convention["order"] == "rgb" else levels[::-1])
    assert turns_apart(solved(folder / "levels.npy", **params), PHASE) < 1e-5


def test_a_picture_of_what_a_bench_shows_is_the_phase_to_half_a_level(tmp_path: Path) -> None:
    full = (240.0, 200.5, 128.0)
    write_rgb(tmp_path / "flat.bmp", LEVELS[::-1])
    turns = LEVELS[::-1] / np.reshape((210.0, 180.0, 150.0), (3, 1, 1))
    shared: dict[str, Any] = {"sign": -1, "origin": 0.4, "two_pi_level": full, "flip_vertical": True}
    write_rgb(tmp_path / "levels.png", Convention(**shared, turns=turns).levels(torch.from_numpy(PHASE)))
    correction = {"file": str(tmp_path / "flat.bmp"), "two_pi_level": [210, 180, 150]}
    found = solved(tmp_path / "levels.png", **shared, correction=correction)
    for channel, level in enumerate(full):
        # where two pi is between two levels, and half
        assert turns_apart(found[channel], PHASE[channel]) < 0.75 / level


def test_a_field_is_encoded_by_the_encoder_that_is_named_whether_in_one_file_or_two(tmp_path: Path) -> None:
    modulus = 0.1 + LEVELS[::-1] / 255
    field = modulus * np.exp(1j * PHASE)
    np.save(tmp_path / "field.npy", field)
    np.save(tmp_path / "phase.npy", PHASE)
    np.save(tmp_path / "modulus.npy", modulus)
    pair = {"amplitude": str(tmp_path / "modulus.npy")}
    assert turns_apart(solved(tmp_path / "field.npy", encoder="phase_only"), PHASE) < 1e-6
    encoded = encode(torch.from_numpy(field))
    assert turns_apart(solved(tmp_path / "field.npy"), encoded) < 1e-5
    assert turns_apart(solved(tmp_path / "phase.npy", **pair), encoded) < 1e-5
    conjugate = solved(tmp_path / "field.npy", encoder="phase_only", sign=-1, origin=0.5)
    assert turns_apart(conjugate, 0.5 - PHASE) < 1e-6


@pytest.mark.parametrize("kind", ["<f4", ">f4", ">f8", "<f2"])
def test_real_numbers_of_any_precision_and_byte_order_are_read(tmp_path: Path, kind: str) -> None:
    np.save(tmp_path / "phase.npy", PHASE.astype(kind))
    np.save(tmp_path / "modulus.npy", np.ones(SHAPE, kind))
    pair = {"amplitude": str(tmp_path / "modulus.npy"), "encoder": "phase_only"}
    apart = 1e-3 if kind == "<f2" else 1e-6  # half precision has eleven bits
    assert turns_apart(solved(tmp_path / "phase.npy"), PHASE) < apart
    assert turns_apart(solved(tmp_path / "phase.npy", **pair), PHASE) < apart


def test_sixteen_bit_levels_in_separate_planes_are_those_of_an_interleaved_picture(tmp_path: Path) -> None:
    levels = LEVELS.astype(np.uint16) * 256
    tifffile.imwrite(tmp_path / "planar.tif", levels, photometric="rgb", planarconfig="separate")
    assert turns_apart(solved(tmp_path / "planar.tif"), PHASE) < 1e-6


def test_one_colour_takes_a_gray_file(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "gray.png"), LEVELS[0])
    assert turns_apart(solved(tmp_path / "gray.png", colours=1), PHASE[:1]) < 1e-6


@pytest.fixture(scope="module")
def wrong_files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wrong")
    np.save(folder / "small.npy", PHASE[:, 1:])
    np.save(folder / "byte.npy", LEVELS)
    np.save(folder / "radians.npy", PHASE[0])
    np.save(folder / "turns.npy", PHASE[0] / math.tau)
    np.save(folder / "complex.npy", np.exp(1j * PHASE))
    np.save(folder / "int.npy", LEVELS.astype(np.int64))
    np.save(folder / "float.npy", LEVELS.astype(np.float64))
    np.save(folder / "nan.npy", np.where(PHASE > 3, np.nan, PHASE))
    np.save(folder / "objects.npy", np.array([{"a": 1}], dtype=object), allow_pickle=True)
    np.save(folder / "text.npy", np.array(["phase"]))
    np.savez(folder / "two.npz", a=PHASE, b=PHASE)
    (folder / "cut.npy").write_bytes((folder / "small.npy").read_bytes()[:200])
    (folder / "new.mat").write_bytes(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM" + bytes(400))
    (folder / "noise.mat").write_bytes(bytes(range(200)))
    savemat(folder / "crash.mat", {"phases": PHASE})
    # double precision, and how many bytes follow
    values = (9).to_bytes(4, "little") + PHASE.nbytes.to_bytes(4, "little")
    crash = (folder / "crash.mat").read_bytes()
    assert crash.count(values) == 1
    (folder / "crash.mat").write_bytes(crash.replace(values, (200).to_bytes(4, "little") + values[4:]))
    savemat(folder / "two.mat", {"a": PHASE, "b": PHASE})
    savemat(folder / "struct.mat", {"a": {"phase": PHASE}})
    (folder / "noise.png").write_bytes(bytes(range(200)))
    cv2.imwrite(str(folder / "alpha.png"), np.zeros((12, 12, 4), np.uint8))
    pixels = np.ascontiguousarray(np.moveaxis(LEVELS, 0, -1))
    picture, turned = Image.fromarray(pixels), Image.Exif()
    turned[274] = 3  # EXIF orientation: upside down
    picture.save(folder / "pages.tif", save_all=True, append_images=[picture.rotate(180)])
    picture.save(folder / "turned.png", exif=turned)
    for ending in ("png", "bmp"):
        Image.fromarray(pixels[..., 0] > 127).save(folder / f"bit.{ending}")
    Image.fromarray(pixels[..., 0] // 16).convert("P").save(folder / "four.png", bits=4)
    for ending in ("png", "tif", "bmp"):
        indices = Image.fromarray(pixels[..., 0])
        indices.putpalette(np.repeat(np.arange(256, dtype=np.uint8)[::-1], 3).tobytes())  # gray, black last
        indices.save(folder / f"palette.{ending}")
    picture.save(folder / "photograph.png", "JPEG")
    np.save(folder / "bool.npy", LEVELS > 127)
    savemat(folder / "logical.mat", {"a": LEVELS > 127})
    huge = np.lib.format.magic(1, 0) + np.uint16(118).tobytes()
    header = "{'descr': '<f8', 'fortran_order': False, 'shape': (900000, 900000), }"
    (folder / "huge.npy").write_bytes(huge + header.ljust(117).encode() + b"\n")
    return folder


@pytest.mark.parametrize(
    ("name", "params", "message"),
    [
        ("gone.npy", {}, "gone.npy: no such file"),
        ("small.npy", {}, r"3 x 11 x 12 values of type float64; 'small' shows 12 x 12 in 3 colours"),
        ("int.npy", {}, "say which level is a full turn: two_pi_level"),
        ("float.npy", {}, "but whole numbers up to 25[0-9], so levels, not radians; set 'levels: all' and two_pi"),
        ("float.npy", {"sign": -1, "origin": 1.0}, r"\(radians that are whole: store them modulo 2 pi\)"),
        ("float.npy", {"two_pi_level": 256}, "two_pi_level is set, but float64 holds radians; levels need"),
        ("float.npy", {"correction": {"file": "FOLDER/byte.npy"}}, "correction is set, but float64 holds radians"),
        ("complex.npy", {"two_pi_level": 256}, "two_pi_level is set, but complex128 holds a field, not levels"),
        ("byte.npy", {"two_pi_level": [256, 250]}, "two_pi_level: 2 levels for 3 colours; expected one for all, or"),
        ("byte.npy", {"correction": {"file": "gone.bmp"}}, "gone.bmp: no such file"),
        *(
            (
                "byte.npy",
                {"correction": {"file": f"FOLDER/{unit}.npy"}},
                "as radians or turns; a correction holds levels",
            )
            for unit in ("radians", "turns")
        ),
        ("byte.npy", {"correction": {"file": "FOLDER/small.npy"}}, "of 3 x 11 x 12 levels; .* 12 x 12 pixels"),
        ("nan.npy", {}, "NaN or infinite"),
        ("objects.npy", {}, "damaged, or no .npy file: Object arrays cannot be loaded"),
        ("text.npy", {}, "holds 1 values of type <U5; expected numbers"),
        ("two.npz", {}, "several variables; name one as 'variable'; it holds a, b"),
        ("two.npz", {"variable": "c"}, "no variable 'c'; it holds a, b"),
        ("cut.npy", {}, "damaged, or no .npy file"),
        ("new.mat", {}, "version 7.3; in MATLAB"),
        ("noise.mat", {}, "damaged, or no .mat file"),
        ("crash.mat", {}, "damaged"),  # an unknown type, which crashes SciPy's reader on some machines
        ("two.mat", {}, "several variables; name one as 'variable'; it holds a, b"),
        ("struct.mat", {}, "'a' is of class struct; expected a full array of numbers"),
        ("noise.png", {}, "no picture of 8 or 16 bits that can be read"),
        ("alpha.png", {}, "a picture with alpha"),
        ("pages.tif", {}, "2 frames or pages; expected a file with one picture"),
        ("turned.png", {}, "EXIF orientation 3; expected one that is stored upright"),
        *((f"palette.{end}", {}, "a picture with a palette; expected gray or RGB") for end in ("png", "tif", "bmp")),
        ("bit.png", {}, "a 1-bit picture; expected 8 or 16 bits"),
        ("bit.bmp", {}, "a 1-bit picture; expected 8 or 16 bits"),
        ("four.png", {}, "a 4-bit picture; expected 8 or 16 bits"),
        ("photograph.png", {}, "no picture of 8 or 16 bits that can be read"),
        ("bool.npy", {}, "holds 432 values of type bool; expected numbers"),
        ("logical.mat", {}, "'a' is of class logical; expected a full array of numbers"),
        ("huge.npy", {}, "an array of more than 1000 MB"),
        ("small.npy", {"amplitude": "gone.npy"}, "3 x 11 x 12"),
    ],
)
def test_a_wrong_file_is_refused_in_one_line(wrong_files: Path, name, params: dict[str, Any], message) -> None:
    if "correction" in params:
        params = {"correction": {"file": params["correction"]["file"].replace("FOLDER", str(wrong_files))}}
    with pytest.raises(CellError, match=message) as found:
        solved(wrong_files / name, **params)
    assert "\n" not in str(found.value)


@pytest.mark.skipif(os.name != "posix", reason="a script of the shell stands for the reader")
@pytest.mark.parametrize(
    ("script", "message"), [("kill -ABRT $$", "damaged: its reader ends with -6"), ("exec sleep 20", "within 0.5 s")]
)
def test_a_reader_that_crashes_or_does_not_end_is_one_line(tmp_path, monkeypatch, script: str, message) -> None:
    reader = tmp_path / "reader"
    reader.write_text(f"#!/bin/sh\n{script}\n")
    reader.chmod(0o700)
    monkeypatch.setattr(sys, "executable", str(reader))
    monkeypatch.setattr(arrays, "SECONDS", 0.5)
    savemat(tmp_path / "a.mat", {"a": PHASE})
    with pytest.raises(CellError, match=message):
        read_array(tmp_path / "a.mat")


@pytest.mark.parametrize(
    ("params", "message"),
    [
        ({"file": "{name}.npy"}, r"'\{name\}' stands for nothing; \{target\}, \{stem\}, \{channel\} and \{frame\} do"),
        ({"file": "phases/{target}.jpg"}, "should end in .png"),
        ({"file": "{target}.npy", "amplitude": "{channel}.npy"}, "in both patterns or in none"),
        ({"two_pi_level": 6.28}, r"'two_pi_level': 6.28 is no level of a full turn; expected 8 to .* \(of a panel"),
        ({"two_pi_level": [256, 0, 256]}, "'two_pi_level.1': 0 is no level of a full turn"),
        ({"correction": {"file": "a.png", "two_pi_level": 1}}, "'correction.two_pi_level': 1 is no level of a full"),
    ],
)
def test_wrong_parameters_are_refused_in_one_line(params: dict[str, Any], message: str) -> None:
    with pytest.raises(UserError, match=message):
        plugins.build("methods", "phases", params)


def test_a_doubled_ending_is_told_with_its_remedy(tmp_path: Path) -> None:
    np.save(tmp_path / "cat.npy", PHASE)
    with pytest.raises(CellError, match=r"cat\.jpg\.npy: no such file; \{stem\} in the place of .*cat\.npy"):
        solved(tmp_path / "{target}.npy")


@pytest.mark.parametrize("radians", [np.arange(12) - 6.0, np.arange(12) * 30.5, np.arange(12) * 1e6])
def test_radians_that_may_be_are_taken(tmp_path: Path, radians: Any) -> None:
    np.save(tmp_path / "a.npy", np.broadcast_to(radians, SHAPE))
    assert turns_apart(solved(tmp_path / "a.npy"), np.broadcast_to(np.float32(radians), SHAPE)) < 1e-3


def test_a_missing_file_names_the_target_whose_name_was_altered(tmp_path: Path) -> None:
    message = r"red_cup\.npy: no such file for the target 'red cup\.png'"
    with pytest.raises(CellError, match=message):
        solved(tmp_path / "{stem}.npy", Bench("red cup.png"))
    for pattern, name in (("{stem}.npy", "cup.png"), ("gone-{channel}.npy", "red cup.png")):
        with pytest.raises(CellError, match=r"no such file$"):
            solved(tmp_path / pattern, Bench(name))


def test_the_name_of_a_target_gives_a_hash_where_it_is_altered_and_a_stem_none() -> None:
    def first(pattern: str, name: str) -> str:
        return str(plugins.build("methods", "phases", {"file": pattern}).files(name)[0])

    assert first("{stem}.png", "red cup.png") == "red_cup.png"
    assert re.fullmatch(r"red_cup\.png-[0-9a-f]{8}\.npy", first("{target}.npy", "red cup.png"))
    assert first("{target}.npy", "cup.png") == "cup.png.npy"
    assert re.fullmatch(r"red_cup-[0-9a-f]{8}\.png", first("{stem}.png", "red cup"))


def test_the_files_of_a_target_are_those_that_are_read() -> None:
    params = {"file": "p/{target}-{channel}.png", "amplitude": "a/{stem}-{channel}.png", "channels": ["r", "g"]}
    found = plugins.build("methods", "phases", params | {"correction": {"file": "flat.bmp"}}).files("my cat.jpg")
    assert [Path(path).parent.name for path in found] == ["p", "p", "a", "a", ""]
    assert all("/my_cat" in path and " " not in path for path in found[:4])
    assert found[4] == "flat.bmp"


def test_full_turns_of_other_colours_are_refused_before_a_study_runs() -> None:
    for params in ({"two_pi_level": [256, 250]}, {"correction": {"file": "flat.bmp", "two_pi_level": [205, 200]}}):
        method = plugins.build("methods", "phases", params)
        with pytest.raises(UserError, match=r"two_pi_level: 2 levels for 3 colours; expected one for all, or one for"):
            method.refuse_display(SPEC)
    plugins.build("methods", "phases", {"two_pi_level": [256, 250, 245]}).refuse_display(SPEC)
