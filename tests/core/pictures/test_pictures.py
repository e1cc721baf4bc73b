"""Whatever wrote a picture, its values come back and what it says of them is known, or one line says why not."""

import io
import itertools
import struct
import zlib

import cv2
import numpy as np
import pytest
import tifffile
import torch
from PIL import Image, ImageCms

from holobench_eval.core.errors import PictureError
from holobench_eval.core.io import write_png
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
    tiles = None, (32, 32)
    for (compression, predictor), order, tile, big in itertools.product(compressions, "<>", tiles, (False, True)):
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
IMAGEJ = "ImageJ=1.54f\nimages=5\nslices=5\n"
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
    "an ImageJ stack behind one header": (tiff(GRAY, "gray", metadata=None, description=IMAGEJ), "5 frames or pages"),
    "cut": (tiff(COLOUR, "contig")[:2000], "damaged"),
    "cut planes": (tiff(samples(np.uint16, "separate"), "separate")[:9000], "damaged"),
}


@pytest.mark.parametrize("what", REFUSED)
def test_samples_of_another_meaning_are_refused_by_name(what: str) -> None:
    content, line = REFUSED[what]
    with pytest.raises(PictureError, match=line) as caught:
        open_picture(content).upright()
    assert "\n" not in str(caught.value)


PIXELS = np.random.default_rng(3).integers(0, 256, (40, 50, 3), dtype=np.uint8)
IMAGE = Image.fromarray(PIXELS)


def chunk(kind: bytes, content: bytes) -> bytes:
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))


def png(data: bytes, width: int, height: int, bits: int, colour: int, interlaced: bool) -> bytes:
    """A PNG of these rows."""
    header = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, bits, colour, 0, 0, interlaced))
    return b"\x89PNG\r\n\x1a\n" + header + chunk(b"IDAT", zlib.compress(data)) + chunk(b"IEND", b"")


def with_chunk(kind: bytes, content: bytes) -> bytes:
    """A PNG with one more chunk behind its header."""
    png = written(IMAGE, "PNG")
    return png[:33] + chunk(kind, content) + png[33:]


def test_a_decoder_prints_nothing_of_a_png(capfd: pytest.CaptureFixture[str]) -> None:
    good = written(IMAGE, "PNG")
    assert open_picture(with_chunk(b"iCCP", b"a\0\0")).values().shape == (40, 50, 3)
    at = good.index(b"IEND") - 8  # the checksum of the pixels
    with pytest.raises(PictureError, match="damaged: a checksum of the PNG is wrong"):
        open_picture(good[:at] + b"none" + good[at + 4 :]).values()
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("form", ["PNG", "TIFF", "WEBP"])
def test_alpha_is_left_out_where_it_is_opaque_and_refused_elsewhere(form: str) -> None:
    options = {"lossless": True} if form == "WEBP" else {}
    clear = IMAGE.convert("RGBA")
    clear.putalpha(Image.fromarray(np.where(np.arange(50) < 1, 254, 255).astype(np.uint8)[None].repeat(40, 0)))
    stored = open_picture(written(clear, form, **options))
    assert stored.has_alpha
    with pytest.raises(PictureError, match="alpha that is not opaque"):
        stored.upright()
    clear.putalpha(255)
    content = written(clear, form, **options)
    assert np.array_equal(open_picture(content).upright(), PIXELS)


@pytest.mark.parametrize("form", ["PNG", "TIFF"])
def test_a_palette_is_looked_up_and_called_one(form: str) -> None:
    indexed = IMAGE.quantize(200)
    stored = open_picture(written(indexed, form))
    assert stored.has_palette
    assert np.array_equal(stored.upright(), np.asarray(indexed.convert("RGB")))


@pytest.mark.parametrize("bits", [1, 2, 4, 8, 16, "colour"])
@pytest.mark.parametrize("interlaced", [False, True])
def test_a_png_of_any_depth_has_its_full_scale_and_all_its_rows(bits: int | str, interlaced: bool) -> None:
    shape, bits, colour = ((9, 16, 3), 8, 2) if bits == "colour" else ((9, 16), bits, 0)
    values = np.random.default_rng(bits).integers(0, 2**bits, shape)
    values[0, 0], values[0, 1] = 0, 2**bits - 1

    def packed(rows: np.ndarray) -> bytes:
        rows = rows.reshape(len(rows), -1)
        if bits == 16:
            return b"".join(b"\0" + row.astype(">u2").tobytes() for row in rows)
        unpacked = ((rows[..., None] >> np.arange(bits)[::-1]) & 1).astype(np.uint8).reshape(len(rows), -1)
        return b"".join(b"\0" + np.packbits(row).tobytes() for row in unpacked)

    steps = [(0, 0, 8, 8), (0, 4, 8, 8), (4, 0, 8, 4), (0, 2, 4, 4), (2, 0, 4, 2), (0, 1, 2, 2), (1, 0, 2, 1)]
    parts = [values[top::down, left::right] for top, left, down, right in steps] if interlaced else [values]
    rows = b"".join(packed(part) for part in parts)

    read = open_picture(png(rows, 16, 9, bits, colour, interlaced)).upright()
    top = 65535 if bits == 16 else 255
    assert np.array_equal(read, values * (top // (2**bits - 1)))
    with pytest.raises(PictureError, match="rows of the PNG are missing"):
        open_picture(png(rows[:-1], 16, 9, bits, colour, interlaced))


def test_a_png_says_by_its_chunks_what_its_values_mean() -> None:
    srgb, linear, other = (struct.pack(">I", value) for value in (45455, 100000, 55556))
    open_picture(with_chunk(b"gAMA", srgb)).refuse_other_colours()
    open_picture(with_chunk(b"gAMA", linear)).refuse_other_colours(linear=True)
    open_picture(with_chunk(b"cICP", bytes([1, 13, 0, 1]))).refuse_other_colours()
    for content, is_linear, line in (
        (with_chunk(b"gAMA", linear), False, "gAMA is 1, that of sRGB 0.45455"),
        (with_chunk(b"gAMA", other), True, "gAMA is 0.55556"),
        (with_chunk(b"cICP", bytes([9, 16, 0, 1])), True, "cICP says 9, 16, 0, 1"),
    ):
        with pytest.raises(PictureError, match=line):
            open_picture(content).refuse_other_colours(is_linear)
    narrow = open_picture(with_chunk(b"sBIT", bytes([5, 5, 5])))  # states what was scaled up, and changes no value
    assert np.array_equal(narrow.upright(), PIXELS)


@pytest.mark.parametrize("form", ["PNG", "TIFF", "JPEG", "WEBP"])
def test_a_profile_is_read_in_every_format(form: str) -> None:
    for space in ("sRGB", "LAB"):
        profile = ImageCms.ImageCmsProfile(ImageCms.createProfile(space)).tobytes()
        stored = open_picture(written(IMAGE, form, icc_profile=profile))
        if space == "sRGB":
            stored.refuse_other_colours()
        else:
            with pytest.raises(PictureError, match="ICC colour profile is 'Lab"):
                stored.refuse_other_colours(linear=True)
    with pytest.raises(PictureError, match="cannot be read"):
        open_picture(written(IMAGE, form, icc_profile=b"no profile")).refuse_other_colours()


PRIMARIES = {
    "sRGB": [(0.4361, 0.2225, 0.0139), (0.3851, 0.7169, 0.0971), (0.1431, 0.0606, 0.7141)],
    "Display P3": [(0.5151, 0.2412, -0.0011), (0.2920, 0.6922, 0.0419), (0.1571, 0.0666, 0.7841)],
}
AXIS = np.arange(1024) / 1023
TABLE = np.where(AXIS <= 0.04045, AXIS / 12.92, ((AXIS + 0.055) / 1.055) ** 2.4)


def fixed(*values: float) -> bytes:
    return b"".join(struct.pack(">i", round(value * 65536)) for value in values)


def curve(*values: int) -> bytes:
    return b"curv" + bytes(4) + struct.pack(f">I{len(values)}H", len(values), *values)


CURVES = {
    "sRGB": b"para" + bytes(4) + struct.pack(">HH", 3, 0) + fixed(2.4, 1 / 1.055, 0.055 / 1.055, 1 / 12.92, 0.04045),
    "a table of sRGB": curve(*np.round(65535 * TABLE).astype(int)),
    "linear": curve(),
    "a gamma of 1": curve(256),
    "a gamma of 1.8": curve(round(1.8 * 256)),
    "a gamma of 2.2": curve(round(2.2 * 256)),
}


def profile(name: str, shape: bytes, primaries: str) -> bytes:
    """An ICC profile of three primaries and a curve; without primaries one for gray."""
    text = b"desc" + bytes(4) + struct.pack(">I", len(name) + 1) + name.encode() + bytes(79)
    tags = [(b"desc", text), (b"cprt", b"text" + bytes(4) + b"none\0")]
    tags += [(b"wtpt", b"XYZ " + bytes(4) + fixed(0.9642, 1.0, 0.8249))]
    if primaries:
        tags += [(b"rgb"[i : i + 1] + b"XYZ", b"XYZ " + bytes(4) + fixed(*PRIMARIES[primaries][i])) for i in range(3)]
    tags += [(channel + b"TRC", shape) for channel in ([b"r", b"g", b"b"] if primaries else [b"k"])]
    at, table, body = 132 + 12 * len(tags), b"", b""
    for key, data in tags:
        padded = data + bytes(-len(data) % 4)
        table, body = table + key + struct.pack(">II", at + len(body), len(padded)), body + padded
    head = struct.pack(">I4sI4s", at + len(body), b"none", 0x02100000, b"mntr") + (b"RGB " if primaries else b"GRAY")
    head = (head + b"XYZ " + bytes(12) + b"acsp" + bytes(28) + fixed(0.9642, 1, 0.8249)).ljust(128, b"\0")
    return head + struct.pack(">I", len(tags)) + table + body


@pytest.mark.parametrize("primaries", ["sRGB", "Display P3", ""])
@pytest.mark.parametrize("shape", CURVES)
def test_a_profile_is_judged_by_its_curves_and_primaries_and_not_by_its_name(shape: str, primaries: str) -> None:
    means = {"sRGB": "sRGB", "a table of sRGB": "sRGB", "linear": "linear", "a gamma of 1": "linear"}.get(shape, "")
    means = "" if primaries == "Display P3" else means
    for name in ("Linear sRGB", "sRGB IEC61966-2.1", "mine"):
        image = IMAGE if primaries else IMAGE.convert("L")
        stored = open_picture(written(image, "PNG", icc_profile=profile(name, CURVES[shape], primaries)))
        for linear in (False, True):
            if means == "sRGB" or (linear and means == "linear"):
                stored.refuse_other_colours(linear)
                continue
            with pytest.raises(PictureError, match=f"'{name}', whose curves or primaries are not those of sRGB"):
                stored.refuse_other_colours(linear)


def with_exif(form: str, space: int, **options: object) -> bytes:
    exif = Image.Exif()
    exif.get_ifd(0x8769)[0xA001] = space
    return written(IMAGE, form, exif=exif.tobytes(), **options)


@pytest.mark.parametrize("form", ["PNG", "TIFF", "JPEG", "WEBP"])
def test_a_colour_space_in_exif_is_believed_where_no_profile_says_another(form: str) -> None:
    srgb = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    for space, refused in ((1, ()), (2, (False, True)), (65535, (False,))):
        open_picture(with_exif(form, space, icc_profile=srgb)).refuse_other_colours()
        stored = open_picture(with_exif(form, space))
        for linear in {False, True}.difference(refused):
            stored.refuse_other_colours(linear)
        for linear in refused:
            with pytest.raises(PictureError, match=f"its EXIF colour space is {space}, that of sRGB 1"):
                stored.refuse_other_colours(linear)


def test_other_primaries_are_refused_in_colour_where_nothing_above_them_is_stated() -> None:
    srgb, p3 = (
        (31270, 32900, *xy)
        for xy in ((64000, 33000, 30000, 60000, 15000, 6000), (68000, 32000, 26500, 69000, 15000, 6000))
    )
    tags = [[(318, 5, 2, _ratios(xy[:2]), True), (319, 5, 6, _ratios(xy[2:]), True)] for xy in (srgb, p3)]
    for good in (with_chunk(b"cHRM", struct.pack(">8I", *srgb)), tiff(COLOUR, "contig", extratags=tags[0])):
        open_picture(good).refuse_other_colours()
    for other in (with_chunk(b"cHRM", struct.pack(">8I", *p3)), tiff(COLOUR, "contig", extratags=tags[1])):
        with pytest.raises(PictureError, match="its primaries or its white are not those of sRGB"):
            open_picture(other).refuse_other_colours()
    open_picture(tiff(GRAY, "gray", extratags=tags[1])).refuse_other_colours()
    above = chunk(b"sRGB", b"\0") + chunk(b"cHRM", struct.pack(">8I", *p3))
    png = written(IMAGE, "PNG")
    open_picture(png[:33] + above + png[33:]).refuse_other_colours()


def _ratios(values: tuple[int, ...]) -> tuple[int, ...]:
    return tuple(itertools.chain.from_iterable((value, 100000) for value in values))


@pytest.mark.parametrize("form", ["PNG", "JPEG", "TIFF", "BMP", "WEBP"])
@pytest.mark.parametrize("kept", [0.05, 0.9])
def test_a_truncated_file_is_refused(form: str, kept: float) -> None:
    content = written(IMAGE, form)
    with pytest.raises(PictureError) as caught:
        open_picture(content[: int(len(content) * kept)]).values()
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("size", [(1, 64_000_000), (7999, 8000), (60000, 60000)])
def test_a_small_file_that_claims_a_huge_image_is_refused_before_it_is_decoded(size, monkeypatch) -> None:
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", None if size == (60000, 60000) else Image.MAX_IMAGE_PIXELS)
    with pytest.raises(PictureError, match="million"):
        open_picture(png(bytes(1000), *size, 8, 2, False))


def test_loss_is_told_by_the_content_and_not_by_the_name() -> None:
    lossy = [written(IMAGE, "JPEG"), written(IMAGE, "WEBP", quality=80), written(IMAGE, "TIFF", compression="jpeg")]
    exact = [written(IMAGE, "PNG"), written(IMAGE, "WEBP", lossless=True), written(IMAGE, "TIFF")]
    assert [open_picture(content).is_lossy for content in (*lossy, *exact)] == [True] * 3 + [False] * 3


def test_a_small_tiff_that_claims_a_huge_image_is_refused_before_it_is_decoded() -> None:
    file = io.BytesIO()
    tifffile.imwrite(file, PIXELS[..., 0], photometric="minisblack", compression="zlib")
    file.seek(0)
    with tifffile.TiffFile(file, mode="r+") as content:
        for tag in ("ImageWidth", "ImageLength", "RowsPerStrip"):
            content.pages.first.tags[tag].overwrite(60_000)
    with pytest.raises(PictureError, match="60000 x 60000 pixels; expected at most 33 million"):
        open_picture(file.getvalue())


@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize("bits", [8, 16])
def test_levels_of_a_png_come_back_as_they_were_written(tmp_path, channels, bits):
    kind = np.uint8 if bits == 8 else np.uint16
    levels = np.random.default_rng(0).integers(0, 2**bits, (channels, 6, 5), dtype=np.int64)
    write_png(tmp_path / "a.png", torch.from_numpy(levels), bits)
    decoded = open_picture((tmp_path / "a.png").read_bytes()).values()
    assert decoded.dtype == kind
    assert np.array_equal(decoded, levels[0] if channels == 1 else levels.transpose(1, 2, 0))
