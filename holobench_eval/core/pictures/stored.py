"""What the header of a picture file says, whatever its format, and the values behind it.

A harness that converts whatever it meets scores pictures nobody looked at: 16 bits read as 8, colours in separate
planes read as noise, a white that is stored as 0. What changes the meaning of a value is understood here or refused.
"""

from __future__ import annotations

import io
import warnings
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageCms, UnidentifiedImageError

from ..errors import PictureError, UserError, reason
from . import png, tiff

FORMATS = ("PNG", "JPEG", "TIFF", "BMP", "WEBP", "GIF")  # no others: Pillow would hand some to outside programs

# 7680 x 4320, more than any panel shows; as linear light an image takes twelve bytes a pixel, and as much for a while.
LARGEST_PIXELS = 33_177_600

ORIENTATION, EXIF, COLOUR_SPACE = 274, 0x8769, 0xA001  # Exif 2.32, sections 4.6.4 and 4.6.5
EXIF_SRGB, UNCALIBRATED = 1, 65535  # of the last
SRGB_GAMMA, LINEAR_GAMMA, SLACK = 0.45455, 1.0, 0.001  # of PNG's chunk gAMA, which writers round
SRGB_PRIMARIES, APART = (0.3127, 0.329, 0.64, 0.33, 0.3, 0.6, 0.15, 0.06), 0.01  # x, y of white, red, green, blue
STEPS = 18  # levels of each colour at which a profile is asked what it means
SRGB_OFF, LINEAR_OFF = 3, 12  # levels of 255; a gamma of 2.2 is 9 off, and 8 bits of linear light in a gray profile 10
# by Pillow's mode: channels without alpha; pictures of other modes are not gray and not RGB
CHANNELS = {"1": 1, "L": 1, "I;16": 1, "LA": 1, "RGB": 3, "RGBA": 3, "P": 3, "PA": 3}

# OpenCV prints what it finds in a damaged file; here that is one line
cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)


@dataclass(frozen=True, eq=False)
class Stored:
    """A picture file whose header has been checked.

    format: one of `FORMATS`; width, height: as stored; channels: 1 or 3 (red, green, blue), those of its colours with
    a palette, without alpha; bits: of a sample, or of an index; is_floating: whether samples are floating point;
    has_palette, has_alpha; is_lossy: compressed with loss; orientation: by EXIF, 1 for upright; profile: the embedded
    ICC profile; gamma: of PNG's gAMA, None without one; primaries: x and y of white, red, green and blue, empty where
    none are stated; colour_space: by EXIF; white_is_zero: a TIFF's samples fall with brightness.
    """

    content: bytes
    format: str
    width: int
    height: int
    channels: int
    bits: int
    is_floating: bool = False
    has_palette: bool = False
    has_alpha: bool = False
    is_lossy: bool = False
    orientation: int = 1
    profile: bytes = b""
    gamma: float | None = None
    primaries: tuple[float, ...] = ()
    colour_space: int = EXIF_SRGB
    white_is_zero: bool = False

    def refuse_other_colours(self, linear: bool = False) -> None:
        """PictureError where the file says that its values are not sRGB; ``linear``: nor proportional to light.

        Many programs call everything sRGB, so that linear values may be called so. The first of cICP, the profile and
        PNG's other chunks prevails.
        """
        if self.format == "PNG" and png.has_curve(self.content, linear):
            return
        if self.profile:
            name, meant = _meaning(self.profile)
            if "sRGB" in meant or (linear and "linear" in meant):
                return
            right = "whose curves or primaries are not those of sRGB; convert it to sRGB"
            raise PictureError(f"its ICC colour profile is '{name[:60]}', {right}")
        if self.gamma is not None:
            allowed = (SRGB_GAMMA, LINEAR_GAMMA) if linear else (SRGB_GAMMA,)
            if all(abs(self.gamma - right) > SLACK for right in allowed):
                raise PictureError(f"its gAMA is {self.gamma:g}, that of sRGB {SRGB_GAMMA}; convert it to sRGB")
        stated = self.primaries if self.channels == 3 and len(self.primaries) == len(SRGB_PRIMARIES) else SRGB_PRIMARIES
        if np.abs(np.subtract(stated, SRGB_PRIMARIES)).max() > APART:
            raise PictureError("its primaries or its white are not those of sRGB; convert it to sRGB")
        if self.colour_space != EXIF_SRGB and not (linear and self.colour_space == UNCALIBRATED):
            right = f"that of sRGB {EXIF_SRGB}, and it has no profile; convert it to sRGB, or take this entry out"
            raise PictureError(f"its EXIF colour space is {self.colour_space}, {right}")

    def values(self) -> NDArray[Any]:
        """``(H, W)`` or ``(H, W, 3)`` uint8, uint16, float32 or float64 as stored, red first, the larger the brighter.

        Fewer than 8 bits come as 8, full scale as full scale. PictureError for what is damaged, and for alpha that is
        not opaque everywhere.
        """
        if self.format == "TIFF":
            decoded = [_decoded(plane) for plane in tiff.plain(self.content)]
        else:
            _load(self.content)  # which reports truncated files that OpenCV would pad
            decoded = [_decoded(png.bare(self.content) if self.format == "PNG" else self.content)]
        values = np.stack(decoded, axis=-1) if len(decoded) > 1 else decoded[0]
        if values.ndim == 3 and len(decoded) == 1:
            values = values[..., [2, 1, 0, 3][: values.shape[2]]]  # OpenCV: blue first
        if self.has_alpha and values.shape[2:] == (4,) and values[..., 3].min() < np.iinfo(values.dtype).max:
            raise PictureError("an image with alpha that is not opaque everywhere")
        if values.ndim == 3:
            values = values[..., 0] if self.channels == 1 else values[..., :3]
        wanted = (self.height, self.width), "f" if self.is_floating else "u", max(1, self.bits // 8)
        if (values.shape[:2], values.dtype.kind, values.dtype.itemsize) != wanted:
            raise PictureError("damaged, or not as its header says")
        return ~values if self.white_is_zero else values

    def upright(self) -> NDArray[Any]:
        """The ``values``, turned and mirrored as the EXIF orientation says."""
        values, turns = self.values(), {3: 2, 4: 2, 5: 3, 6: 3, 7: 1, 8: 1}.get(self.orientation, 0)
        turned = np.rot90(values, turns)
        return np.ascontiguousarray(turned[:, ::-1] if self.orientation in (2, 4, 5, 7) else turned)


def open_picture(content: bytes, largest: int = LARGEST_PIXELS) -> Stored:
    """A picture file by its header, before anything of it is decoded.

    largest: pixels that it may have. PictureError, a fault without the name of the file, for what is damaged or no
    picture, holds several of them, is larger, or has samples whose meaning is not known here.
    """
    try:
        if content[:4] in tiff.SIGNATURES:
            stored = Stored(content, "TIFF", **tiff.facts(content))
            _refuse_large(stored.width, stored.height, largest)
            return stored
        with warnings.catch_warnings():
            # Pillow's own limit, which an importing program may have lifted, is only the first line.
            warnings.simplefilter("ignore")
            image = Image.open(io.BytesIO(content), formats=FORMATS)
            _refuse_large(image.width, image.height, largest)
            return _stored(content, image)
    except UserError:
        raise
    except Image.DecompressionBombError as error:
        raise PictureError(f"claims more than {largest // 10**6} million pixels") from error
    except UnidentifiedImageError as error:
        raise PictureError(f"not an image in {', '.join(FORMATS)}, or its header is damaged") from error
    except Exception as error:  # whatever a reader trips over in a damaged file
        raise PictureError(f"damaged: {reason(error)}") from error


def _refuse_large(width: int, height: int, largest: int) -> None:
    if not width * height:
        raise PictureError("damaged: no size in its header")
    if width * height > largest:
        raise PictureError(f"{width} x {height} pixels; expected at most {largest // 10**6} million")


def _stored(content: bytes, image: Image.Image) -> Stored:
    """The facts of any format but TIFF."""
    if (frames := getattr(image, "n_frames", 1)) != 1:
        raise PictureError(f"{frames} frames or pages; expected a file with one picture")
    mode, form, bits = image.mode, str(image.format), 8
    if mode not in CHANNELS:
        raise PictureError(f"a {mode} image")
    if "transparency" in image.info:
        raise PictureError("an image with a transparent colour")
    if form == "PNG":
        png.refuse_short(content, image.width, image.height)
        bits = content[24]  # Pillow shows 16-bit RGB as 8-bit; section 11.2.1 (IHDR)
    if form == "BMP":
        depth = content[28]  # BITMAPINFOHEADER, biBitCount: of a pixel
        bits = 5 if depth == 16 else min(depth, 8)
    exif, colours = image.getexif(), {} if "srgb" in image.info else image.info  # that chunk stands above the others
    return Stored(
        content,
        form,
        image.width,
        image.height,
        CHANNELS[mode],
        bits,
        has_palette=mode in ("P", "PA"),
        has_alpha=mode in ("LA", "PA", "RGBA"),
        is_lossy=form == "JPEG" or (form == "WEBP" and b"VP8L" not in content[:64]),
        orientation=exif.get(ORIENTATION, 1),
        profile=image.info.get("icc_profile") or b"",
        gamma=colours.get("gamma"),
        primaries=colours.get("chromaticity", ()),
        colour_space=EXIF_SRGB if "srgb" in image.info else exif.get_ifd(EXIF).get(COLOUR_SPACE, EXIF_SRGB),
    )


@lru_cache(maxsize=8)  # of the pictures of a folder
def _meaning(profile: bytes) -> tuple[str, frozenset[str]]:
    """The name of an ICC profile, and whether it means ``sRGB`` or ``linear`` light by what it makes of some colours.

    Its name is no evidence: "Linear sRGB" is one.
    """
    try:
        opened = ImageCms.ImageCmsProfile(io.BytesIO(profile))
        name = " ".join(ImageCms.getProfileDescription(opened).split())
        mode = {"RGB": "RGB", "GRAY": "L"}.get(opened.profile.xcolor_space.strip())
        if mode is None:
            return name, frozenset()
        intent = ImageCms.Intent.RELATIVE_COLORIMETRIC
        way = ImageCms.buildTransform(opened, ImageCms.createProfile("sRGB"), mode, "RGB", renderingIntent=intent)
    except (OSError, ImageCms.PyCMSError) as error:
        right = "convert it to sRGB, or leave the profile out"
        raise PictureError(f"its ICC colour profile cannot be read; {right}") from error
    axis = np.linspace(0, 255, STEPS).round().astype(np.uint8)
    colours = np.stack(np.meshgrid(axis, axis, axis) if mode == "RGB" else [axis[None]] * 3, axis=-1).reshape(1, -1, 3)
    meant = np.asarray(ImageCms.applyTransform(Image.fromarray(colours).convert(mode), way), dtype=np.float64)
    light = colours / 255
    encoded = 255 * np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    kinds = {"sRGB": (colours, SRGB_OFF), "linear": (encoded, LINEAR_OFF)}
    return name, frozenset(kind for kind, (right, off) in kinds.items() if np.abs(meant - right).max() <= off)


def _load(content: bytes) -> None:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            Image.open(io.BytesIO(content), formats=FORMATS).load()
    except Exception as error:  # whatever a decoder trips over in a damaged file
        raise PictureError(f"truncated or damaged: {reason(error)}") from error


def _decoded(content: bytes) -> NDArray[Any]:
    try:
        values: NDArray[Any] | None = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error:
        values = None
    if values is None:
        raise PictureError("truncated or damaged, or compressed in a way that cannot be read here")
    return values
