"""Whatever wrote a picture, however it lays out its samples: the same values come back, or one line says why not."""

import io
import itertools

import cv2
import numpy as np
import pytest
import tifffile
from PIL import Image

from holobench_eval.core.errors import PictureError
from holobench_eval.core.pictures import open_picture

SHAPE = (45, 53)  # no multiple of a tile or strip
KINDS = (np.uint8, np.uint16, np.float32, np.float64)
LAYOUTS = {"gray": "minisblack", "white is zero": "miniswhite", "contig": "rgb", "separate": "rgb"}


def samples(kind: type, layout: str) -> np.ndarray:
    """``(H, W)`` or ``(H, W, 3)``."""
    shape = SHAPE if "rgb" not in LAYOUTS[layout] else (*SHAPE, 3)
    values = np.random.default_rng(0).random(shape)
    return values.astype(kind) if np.dtype(kind).kind == "f" else (values * np.iinfo(kind).max).astype(kind)


def tiff(values: np.ndarray, layout: str, **options: object) -> bytes:
    file = io.BytesIO()
    stored = np.ascontiguousarray(values.transpose(2, 0, 1)) if layout == "separate" else values
    planar = {} if LAYOUTS[layout] != "rgb" else {"planarconfig": layout}
    tifffile.imwrite(file, stored, photometric=LAYOUTS[layout], **planar, **options)
    return file.getvalue()


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("kind", KINDS)
def test_a_tiff_gives_its_samples_in_every_layout_or_is_refused(kind: type, layout: str) -> None:
    values = samples(kind, layout)
    is_float = np.dtype(kind).kind == "f"
    compressions = [(None, None), ("zlib", None), *([] if is_float else [("zlib", True)])]
    for (compression, predictor), order, tile, big in itertools.product(
        compressions, "<>", (None, (32, 32)), (False, True)
    ):
        rows = None if tile else 7
        options = {"compression": compression, "predictor": predictor, "byteorder": order, "bigtiff": big}
        content = tiff(values, layout, tile=tile, rowsperstrip=rows, **options)
        if is_float and layout == "white is zero":
            with pytest.raises(PictureError, match="whose white is 0"):
                open_picture(content)
            continue
        read = open_picture(content).upright()
        assert read.dtype == values.dtype
        assert np.array_equal(read, ~values if layout == "white is zero" else values), (options, tile)


@pytest.mark.parametrize("kind", KINDS[:3])
@pytest.mark.parametrize("layout", ["gray", "contig"])
def test_a_tiff_of_opencv_with_lzw_and_its_predictors_gives_its_samples(kind: type, layout: str) -> None:
    values = samples(kind, layout)
    for predictor in (1, 3 if np.dtype(kind).kind == "f" else 2):
        options = [cv2.IMWRITE_TIFF_COMPRESSION, 5, cv2.IMWRITE_TIFF_PREDICTOR, predictor]
        content = cv2.imencode(".tif", values[..., ::-1] if values.ndim == 3 else values, options)[1].tobytes()
        assert np.array_equal(open_picture(content).upright(), values)


def written(image: Image.Image, kind: str, **options: object) -> bytes:
    file = io.BytesIO()
    image.save(file, kind, **options)
    return file.getvalue()


PLAIN = [
    *(("TIFF", {"compression": each}) for each in ("raw", "tiff_lzw", "packbits", "tiff_adobe_deflate")),
    *(("PNG", {}), ("BMP", {}), ("WEBP", {"lossless": True})),
]


@pytest.mark.parametrize(("form", "options"), PLAIN)
@pytest.mark.parametrize("layout", ["gray", "contig"])
@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_what_pillow_writes_without_loss_comes_back(form: str, options: dict, layout: str, kind: type) -> None:
    values = samples(kind, layout)
    if kind is np.uint16 and (layout == "contig" or form in ("BMP", "WEBP")):
        pytest.skip("Pillow has no such picture")
    if form == "WEBP" and layout == "gray":
        pytest.skip("WebP has no gray")
    stored = open_picture(written(Image.fromarray(values), form, **options))
    assert (stored.format, stored.bits, stored.is_lossy) == (form, 8 * values.dtype.itemsize, False)
    assert np.array_equal(stored.upright(), values)


@pytest.mark.parametrize("form", ["PNG", "TIFF", "JPEG", "WEBP"])
@pytest.mark.parametrize("orientation", range(1, 9))
def test_the_exif_orientation_is_followed_where_asked_for(form: str, orientation: int) -> None:
    image, exif = Image.fromarray(samples(np.uint8, "contig")), Image.Exif()
    exif[274] = orientation
    options = {"JPEG": {"quality": 95}, "WEBP": {"lossless": True}}.get(form, {})
    plain = open_picture(written(image, form, **options)).values()
    stored = open_picture(written(image, form, exif=exif, **options))
    turned = {1: plain, 2: plain[:, ::-1], 3: plain[::-1, ::-1], 4: plain[::-1], 5: plain.transpose(1, 0, 2)}
    turned |= {6: np.rot90(plain, 3), 7: plain[::-1, ::-1].transpose(1, 0, 2), 8: np.rot90(plain)}
    assert np.array_equal(stored.values(), plain)
    assert np.array_equal(stored.upright(), turned[orientation])


GRAY, COLOUR = samples(np.uint8, "gray"), samples(np.uint8, "contig")
CURVE = (291, 3, 256, tuple(range(256)), True)
REFUSED = {
    "signed": (tiff(GRAY.astype(np.int16), "gray"), "16-bit image of signed numbers"),
    "32 bits": (tiff(GRAY.astype(np.uint32), "gray"), "32-bit image"),
    "half precision": (tiff(GRAY.astype(np.float16), "gray"), "16-bit floating-point"),
    "CMYK": (written(Image.fromarray(COLOUR).convert("CMYK"), "TIFF"), "CMYK"),
    "CIELAB": (written(Image.fromarray(COLOUR).convert("LAB"), "TIFF"), "CIELAB"),
    "YCbCr": (written(Image.fromarray(COLOUR).convert("YCbCr"), "TIFF"), "photometric interpretation 6"),
    "gray with alpha": (written(Image.fromarray(GRAY).convert("LA"), "TIFF"), "alpha beside gray"),
    "a response curve": (tiff(COLOUR, "contig", extratags=[CURVE]), "response curve"),
    "pages": (tiff(np.stack([GRAY, GRAY]), "gray"), "2 frames or pages"),
    "pages behind one header": (tiff(np.stack([GRAY] * 3), "gray", truncate=True), "3 frames or pages"),
    "an ImageJ stack behind one header": (
        tiff(GRAY, "gray", metadata=None, description="ImageJ=1.54f\nimages=5\nslices=5\n"),
        "5 frames or pages",
    ),
    "cut": (tiff(COLOUR, "contig")[:2000], "damaged"),
    "cut planes": (tiff(samples(np.uint16, "separate"), "separate")[:9000], "damaged"),
}


@pytest.mark.parametrize("what", REFUSED)
def test_samples_of_another_meaning_are_refused_by_name(what: str) -> None:
    content, line = REFUSED[what]
    with pytest.raises(PictureError, match=line) as caught:
        open_picture(content).upright()
    assert "\n" not in str(caught.value)
