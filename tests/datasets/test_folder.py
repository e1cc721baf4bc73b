"""A folder of images and its manifest, also against a hostile one."""

import hashlib
import os
from pathlib import Path

import numpy as np
import pytest
import torch
from PIL import Image

from holobench_eval.core.errors import UserError
from holobench_eval.datasets import folder
from holobench_eval.datasets.folder import Folder
from holobench_eval.optics import srgb_decode


def save(path: Path, seed: int = 0, mode: str = "RGB") -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    pixels = np.random.default_rng(seed).integers(0, 256, (10, 16, 3), dtype=np.uint8)
    Image.fromarray(pixels).convert(mode).save(path)
    return path


def sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def refusal(dataset: Folder) -> str:
    with pytest.raises(UserError) as caught:
        dataset.items()
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.fixture
def pictures(tmp_path) -> Path:
    place = tmp_path / "pictures"
    for seed, name in enumerate(("0002.png", "0001.PNG", "sub/deep.png")):
        save(place / name, seed)
    return place


def pinned(place: Path, *lines: str) -> Folder:
    manifest = place / "SHA256SUMS"
    manifest.write_text("".join(line + "\n" for line in lines))
    return Folder(str(place), manifest=str(manifest))


def test_items_are_the_images_of_the_folder_by_name_with_the_pixels_of_the_files(pictures, monkeypatch):
    (pictures / "README.txt").write_text("not an image")
    save(pictures / ".hidden.png")
    assert Folder(str(pictures)).items() == ["0001.PNG", "0002.png"]
    assert Folder(str(pictures), count=1).items() == ["0001.PNG"]
    monkeypatch.chdir(pictures.parent)
    assert Folder("pictures").items() == ["0001.PNG", "0002.png"]
    pixels = np.asarray(Image.open(pictures / "0002.png"))
    wanted = srgb_decode(torch.from_numpy(pixels / 255)).float().permute(2, 0, 1)
    assert torch.allclose(Folder(str(pictures)).load("0002.png", (10, 16)), wanted, atol=1e-6)


def test_the_digest_is_that_of_the_file_decoded_once_and_that_of_a_manifest(pictures, monkeypatch):
    dataset = Folder(str(pictures))
    before = dataset.digest("0002.png")
    assert before == sha256(pictures / "0002.png")
    save(pictures / "0002.png", seed=9)
    os.utime(pictures / "0002.png", ns=(1, 1))
    assert dataset.digest("0002.png") == sha256(pictures / "0002.png") != before
    dataset.items()
    monkeypatch.setattr(folder, "decode", None)
    assert dataset.items() == ["0001.PNG", "0002.png"]
    monkeypatch.undo()
    dataset = pinned(pictures, f"{sha256(pictures / '0002.png')}  0002.png")
    save(pictures / "0002.png", seed=8)
    os.utime(pictures / "0002.png", ns=(2, 2))
    assert "the file has changed" in refusal(dataset)
    with pytest.raises(UserError, match="the file has changed"):
        dataset.load("0002.png", (8, 8))


def test_a_message_says_where_a_relative_path_was_looked_for(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert "no images" in refusal(Folder(str(tmp_path)))
    looked = f"in the working directory {Path.cwd()}, where paths of images start; "
    assert refusal(Folder("my/images")).startswith(f"my/images: no such folder {looked}dataset 'folder' needs")
    save(tmp_path / "my" / "file.png")
    assert refusal(Folder("my", manifest="none")).startswith(f"none: no such manifest {looked}write one with")
    for folder_, line in ((str(tmp_path / "nowhere"), "no such folder"), ("my/file.png", "not a folder")):
        assert line in refusal(Folder(folder_))
        assert "working directory" not in refusal(Folder(folder_))


def test_one_bad_image_a_pipe_or_an_unprintable_name_stops_before_anything_is_computed(pictures):
    os.mkfifo(pictures / "pipe.png")
    assert "not a regular file" in refusal(Folder(str(pictures)))
    (pictures / "pipe.png").unlink()
    save(pictures / "a\nb.png")
    assert "cannot be printed" in refusal(Folder(str(pictures)))
    (pictures / "a\nb.png").unlink()
    content = (pictures / "0002.png").read_bytes()
    (pictures / "0002.png").write_bytes(content[: len(content) // 2])
    line = refusal(Folder(str(pictures)))
    assert line.startswith(f"{pictures / '0002.png'}: truncated or damaged")
    assert "expected an 8-bit RGB image in sRGB" in line


def test_a_message_names_the_gray_images_and_says_how_to_take_them(pictures):
    for number in range(3, 10):
        save(pictures / f"000{number}.png", mode="L")
    line = refusal(Folder(str(pictures)))
    assert "7 of 9 images have one channel (0003.png, 0004.png, 0005.png, 0006.png, 0007.png and 2 more)" in line
    assert "gray: true in params" in line
    assert "0003.png" in Folder(str(pictures), gray=True).items()


def test_a_manifest_chooses_and_pins_the_images(pictures):
    lines = [f"{sha256(pictures / name)}  {name}" for name in ("sub/deep.png", "0002.png")]
    dataset = pinned(pictures, *lines)
    assert dataset.items() == ["0002.png", "sub/deep.png"]
    assert dataset.load("sub/deep.png", (8, 8)).shape == (3, 8, 8)
    digest = sha256(pictures / "0002.png")
    for line in (f"{digest} *0002.png", f"{digest.upper()}  ./0002.png", f"{digest}  0002.png\r"):
        assert pinned(pictures, line, "").items() == ["0002.png"]


@pytest.mark.parametrize("name", ["../secret.png", "/etc/hostname", "sub/../../secret.png"])
def test_a_manifest_cannot_name_a_file_outside_its_folder(pictures, name):
    digest = sha256(save(pictures.parent / "secret.png"))
    assert "leaves the folder" in refusal(pinned(pictures, f"{digest}  {name}"))


def test_a_link_out_of_the_folder_is_refused_and_one_within_it_fine(pictures):
    secret = save(pictures.parent / "secret.png")
    (pictures / "link.png").symlink_to(secret)
    assert "leads out of the folder" in refusal(Folder(str(pictures)))
    assert "leads out of the folder" in refusal(pinned(pictures, f"{sha256(secret)}  link.png"))
    (pictures / "out").symlink_to(pictures.parent)
    assert "leads out of the folder" in refusal(pinned(pictures, f"{sha256(secret)}  out/secret.png"))
    (pictures / "link.png").unlink()
    (pictures / "0003.png").symlink_to("0002.png")
    (pictures.parent / "alias").symlink_to(pictures)
    assert Folder(str(pictures.parent / "alias")).items() == ["0001.PNG", "0002.png", "0003.png"]


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (["nonsense"], ":1: not a line of sha256sum"),
        (["", "0123  a.png"], ":2: not a line of sha256sum"),
        ([f"{'0' * 64}  a\\b.png"], "cannot be used"),
        ([f"{'0' * 64}  a\x1b[2J.png"], "cannot be used"),
        ([f"{'0' * 64}  a.png", f"{'1' * 64}  ./a.png"], ":2: 'a.png' is listed twice"),
        ([], "the manifest is empty"),
        ([f"{'0' * 64}  gone.png"], "no such file, but"),
    ],
)
def test_a_broken_manifest_is_one_line_with_its_number(pictures, lines, message):
    assert message in refusal(pinned(pictures, *lines))


def test_a_manifest_that_is_missing_no_text_or_huge_is_one_line(pictures, monkeypatch):
    assert "no such manifest" in refusal(Folder(str(pictures), manifest=str(pictures / "none")))
    assert "not UTF-8" in refusal(Folder(str(pictures), manifest=str(pictures / "0002.png")))
    monkeypatch.setattr(folder, "LARGEST_MANIFEST", 3)
    assert "larger than" in refusal(pinned(pictures, "long"))


@pytest.mark.parametrize("item", ["../secret.png", "sub/deep.png", "README.txt", "0009.png"])
def test_only_items_can_be_loaded(pictures, item):
    save(pictures.parent / "secret.png")
    (pictures / "README.txt").write_text("not an image")
    with pytest.raises(UserError):
        Folder(str(pictures)).load(item, (8, 8))
