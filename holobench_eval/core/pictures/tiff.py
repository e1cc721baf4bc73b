"""What a TIFF's tags say of its samples (TIFF 6.0), and a copy of them that OpenCV decodes as it is meant.

OpenCV reads colours in separate planes as noise, and inverts a picture whose white is 0 at some depths and not at
others; both come out right from planes that are called gray.
"""

from __future__ import annotations

import io
import math
from typing import Any

from tifffile import TiffFile, TiffPage
from tifffile import logger as tifffile_logger

from ..errors import PictureError

SIGNATURES = (b"II*\x00", b"MM\x00*", b"II+\x00", b"MM\x00+")  # the last two: BigTIFF
WHITE_IS_ZERO, GRAY, RGB, PALETTE, YCBCR = 0, 1, 2, 3, 6
PHOTOMETRIC = {5: "a CMYK image", 8: "a CIELAB image", 32803: "the mosaic of a camera", 34892: "a camera's raw image"}
JPEG = 7
LOSSY = (6, JPEG, 33003, 33004, 33005, 34712, 34887, 50001, 50002)  # JPEG, JPEG 2000, LERC, WebP, JPEG XL
UINT, FLOAT = 1, 3  # SampleFormat
CURVES = (291, 301)  # GrayResponseCurve, TransferFunction: other meanings of the same numbers

tifffile_logger().setLevel("CRITICAL")  # what it says of a damaged file; here that is one line


def facts(content: bytes) -> dict[str, Any]:
    """The fields of a `Stored`. PictureError for samples whose meaning is not known here."""
    with TiffFile(io.BytesIO(content)) as file:
        if (pages := max(len(file.pages), _pictures(file))) != 1:
            raise PictureError(f"{pages} frames or pages; expected a file with one picture")
        return _facts(_page(file))


def plain(content: bytes) -> list[bytes]:
    """The file, or one for each colour where these lie in separate planes, with its pixels as they are stored."""
    with TiffFile(io.BytesIO(content)) as file:
        page = _page(file)
        planes = page.samplesperpixel if page.planarconfig == 2 and page.samplesperpixel > 1 else 1
        if planes == 1 and page.photometric != WHITE_IS_ZERO and "Orientation" not in page.tags:
            return [content]
    return [_plane(content, index, planes) for index in range(planes)]


def _page(file: TiffFile) -> TiffPage:
    page = file.pages.first
    assert isinstance(page, TiffPage)
    return page


def _pictures(file: TiffFile) -> int:
    """Pictures in a file of one page: tifffile and ImageJ write many behind the header of the first.

    Asked without `TiffFile.series`, which opens other files that a file may name.
    """
    shaped: Any = file.shaped_metadata or [{}]
    imagej = file.imagej_metadata or {}
    behind = math.prod(shaped[0].get("shape", ())) // max(_page(file).size, 1)
    return max(1, behind, int(imagej.get("images", 1)))


def _facts(page: TiffPage) -> dict[str, Any]:
    photometric, samples, extra = int(page.photometric), page.samplesperpixel, page.extrasamples
    colours = 3 if photometric in (RGB, YCBCR) else 1
    bits: Any = page.bitspersample  # or one for each sample
    form = int(page.sampleformat)
    if photometric not in (WHITE_IS_ZERO, GRAY, RGB, PALETTE) and (photometric, page.compression) != (YCBCR, JPEG):
        raise PictureError(PHOTOMETRIC.get(photometric, f"an image of photometric interpretation {photometric}"))
    if isinstance(bits, tuple) or (form, bits) not in {(UINT, 1), (UINT, 8), (UINT, 16), (FLOAT, 32), (FLOAT, 64)}:
        kind = {UINT: "a {}-bit image", FLOAT: "a {}-bit floating-point image"}.get(
            form, "a {}-bit image of signed numbers"
        )
        raise PictureError(kind.format("/".join(map(str, bits)) if isinstance(bits, tuple) else bits))
    if bits not in (8, 16) and photometric == WHITE_IS_ZERO:
        raise PictureError(f"a {bits}-bit image whose white is 0")
    if samples != colours + len(extra) or len(extra) > 1 or page.imagedepth != 1:
        raise PictureError(f"an image of {samples} samples a pixel; expected {colours}")
    if page.planarconfig == 2 and len(page.dataoffsets) % samples:
        raise PictureError("damaged: colours in separate planes of different sizes")
    if extra and (colours == 1 or page.planarconfig == 2):
        raise PictureError("an image with alpha beside gray, or in a plane of its own")
    if any(tag in page.tags for tag in CURVES):
        raise PictureError("an image with a response curve of its own")
    orientation = page.tags.valueof("Orientation", 1)
    if orientation not in range(1, 9):
        raise PictureError(f"an image of orientation {orientation}; expected 1 to 8")
    own = page.tags.valueof("PrimaryChromaticities")
    ratios = (*page.tags.valueof("WhitePoint", (3127, 10000, 3290, 10000)), *own) if own else ()
    return {
        "width": page.imagewidth,
        "height": page.imagelength,
        "channels": 3 if photometric == PALETTE else colours,
        "bits": bits,
        "is_floating": form == FLOAT,
        "has_palette": photometric == PALETTE,
        "has_alpha": bool(extra),
        "is_lossy": page.compression in LOSSY,
        "orientation": orientation,
        "profile": page.iccprofile or b"",
        "primaries": tuple(top / (bottom or 1) for top, bottom in zip(ratios[::2], ratios[1::2], strict=False)),
        "colour_space": (page.tags.valueof("ExifTag") or {}).get("ColorSpace", 1),
        "white_is_zero": photometric == WHITE_IS_ZERO,
    }


def _plane(content: bytes, index: int, planes: int) -> bytes:
    """The file with its tags calling one of its planes a picture that is stored upright, and gray if black is not 0."""
    copy = io.BytesIO(content)
    with TiffFile(copy, mode="r+") as file:
        page = _page(file)
        changed: dict[str, Any] = {"Orientation": 1}
        if planes > 1 or page.photometric == WHITE_IS_ZERO:
            changed["PhotometricInterpretation"] = GRAY
        if planes > 1:
            count = len(page.dataoffsets) // planes
            own = slice(index * count, (index + 1) * count)
            kind = "Tile" if page.is_tiled else "Strip"
            changed |= {f"{kind}Offsets": page.dataoffsets[own], f"{kind}ByteCounts": page.databytecounts[own]}
            changed |= {"SamplesPerPixel": 1, "PlanarConfiguration": 1}
            changed |= {"BitsPerSample": page.bitspersample, "SampleFormat": int(page.sampleformat)}
        for name, value in changed.items():
            if name in page.tags:
                page.tags[name].overwrite(value)
    return copy.getvalue()
