"""Image files: what is taken, and that everything else is refused in one line.

What decoding alone decides, in every format and layout, is in tests/core/pictures.
"""

import io

import cv2
import numpy as np
import pytest
import torch
from PIL import Image, ImageOps

from holobench_eval.core.errors import UserError
from holobench_eval.datasets import images
from holobench_eval.datasets.images import decode, read
from holobench_eval.optics import srgb_decode

PIXELS = np.random.default_rng(5).integers(0, 256, (12, 20, 3), dtype=np.uint8)
DEEP = np.random.default_rng(6).integers(0, 65536, (12, 20, 3), dtype=np.uint16)


def encoded(image: Image.Image, kind: str = "PNG", **options: object) -> bytes:
    file = io.BytesIO()
    image.save(file, kind, **options)
    return file.getvalue()


def deep(pixels: np.ndarray, suffix: str = ".png") -> bytes:
    return cv2.imencode(suffix, pixels[..., ::-1] if pixels.ndim == 3 else pixels)[1].tobytes()


def linear(pixels: np.ndarray) -> torch.Tensor:
    return srgb_decode(torch.from_numpy(pixels.astype(np.float64)) / np.iinfo(pixels.dtype).max).float()


def refusal(content: bytes, **options) -> str:
    with pytest.raises(UserError) as caught:
        decode(content, "folder/x.png", **options)
    line = str(caught.value)
    assert line.startswith("folder/x.png: ")
    assert "expected" in line
    assert "\n" not in line
    return line


RGB = Image.fromarray(PIXELS)


@pytest.mark.parametrize("kind", ["PNG", "BMP"])
def test_eight_bit_rgb_is_decoded_to_linear_light(kind):
    found = decode(encoded(RGB, kind), "x")
    assert torch.allclose(found, linear(PIXELS).permute(2, 0, 1), atol=1e-6)


KINDS = {
    "one channel": (encoded(RGB.convert("L")), "one-channel"),
    "alpha": (encoded(Image.merge("RGBA", [*RGB.split(), RGB.getchannel(0)])), "alpha that is not opaque"),
    "palette": (encoded(RGB.convert("P")), "palette"),
    "one bit": (encoded(RGB.convert("1")), "1-bit"),
    "CMYK": (encoded(RGB.convert("CMYK"), "JPEG"), "CMYK"),
    "floating point": (encoded(RGB.convert("F"), "TIFF"), "floating-point"),
    "transparent colour": (encoded(RGB, transparency=(0, 0, 0)), "transparent colour"),
    "16-bit": (deep(DEEP), "16-bit"),
    "two frames": (encoded(RGB, save_all=True, append_images=[ImageOps.mirror(RGB)]), "2 frames"),
    "PostScript": (b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 9 9\n%%EndComments\n", "not an image"),
}


@pytest.mark.parametrize("kind", list(KINDS))
def test_every_other_kind_is_refused_by_its_name(kind):
    content, word = KINDS[kind]
    assert word in refusal(content)


def test_gray_is_replicated_when_it_is_asked_for():
    gray = PIXELS[..., 0]
    found = decode(encoded(Image.fromarray(gray)), "x", gray=True)
    assert torch.allclose(found, linear(gray).expand(3, -1, -1), atol=1e-6)
    assert torch.equal(decode(encoded(Image.fromarray(gray).convert("LA")), "x", gray=True), found)
    assert "not opaque" in refusal(encoded(Image.merge("LA", RGB.split()[:2])), gray=True)
    assert "1-bit" in refusal(encoded(RGB.convert("1")), gray=True)


@pytest.mark.parametrize("suffix", [".png", ".tiff"])
def test_16_bit_levels_keep_their_precision_as_srgb_or_as_linear_light(suffix):
    content = deep(DEEP, suffix)
    as_srgb, as_linear = decode(content, "x", sixteen_bit="srgb"), decode(content, "x", sixteen_bit="linear")
    assert torch.allclose(as_srgb, linear(DEEP).permute(2, 0, 1), atol=1e-6)
    assert torch.allclose(as_linear, torch.from_numpy(DEEP / 65535).float().permute(2, 0, 1), atol=1e-7)


def test_16_bit_gray_needs_both_choices():
    exif = Image.Exif()
    exif[274] = 6  # stored on its side
    content = encoded(Image.fromarray(DEEP[..., 0]), "TIFF", exif=exif)
    assert "one-channel" in refusal(content, sixteen_bit="linear")
    assert "16-bit" in refusal(content, gray=True)
    found = decode(content, "x", gray=True, sixteen_bit="linear")
    wanted = torch.from_numpy(np.rot90(DEEP[..., 0], 3) / 65535).float().expand(3, -1, -1)
    assert torch.allclose(found, wanted, atol=1e-7)


def test_reading_refuses_what_is_no_file(tmp_path, monkeypatch):
    with pytest.raises(UserError, match="no such file"):
        read(tmp_path / "missing.png")
    with pytest.raises(UserError, match="not a regular file"):
        read(tmp_path)
    monkeypatch.setattr(images, "LARGEST_BYTES", 10)
    (tmp_path / "large.png").write_bytes(bytes(11))
    with pytest.raises(UserError, match="larger than"):
        read(tmp_path / "large.png")
