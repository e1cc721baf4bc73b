"""What a PNG says beyond Pillow's view of it (PNG specification, third edition)."""

from __future__ import annotations

import zlib
from collections.abc import Iterator

from ..errors import PictureError

END = b"\x00\x00\x00\x00IEND\xaeB`\x82"  # the last chunk of every PNG, section 11.2.4
SAMPLES = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}  # a pixel, by colour type, section 11.2.1
PALETTE, ALPHA = 3, (4, 6)
# of cICP: primaries of sRGB and its curve or none, section 11.3.2.6
SRGB, LINEAR = b"\x01\x0d\x00\x01", b"\x01\x08\x00\x01"
# first row and column and steps between them of the pictures that an interlaced one consists of, section 8.1
WHOLE = ((0, 0, 1, 1),)
INTERLACED = ((0, 0, 8, 8), (0, 4, 8, 8), (4, 0, 8, 4), (0, 2, 4, 4), (2, 0, 4, 2), (0, 1, 2, 2), (1, 0, 2, 1))


def refuse_short(content: bytes, width: int, height: int) -> None:
    """PictureError for a PNG without its end or with too few rows: Pillow takes the first and fills up the second."""
    if END not in content:
        raise PictureError("truncated or damaged: the end of the PNG is missing")
    bits = content[24] * SAMPLES.get(content[25], 0)
    size = 0
    for top, left, down, right in INTERLACED if content[28] else WHOLE:
        rows, columns = -(-(height - top) // down), -(-(width - left) // right)
        size += rows * (1 + (columns * bits + 7) // 8) if columns > 0 else 0
    if _inflated(content, size) < size:
        raise PictureError("truncated or damaged: rows of the PNG are missing")


def has_curve(content: bytes, linear: bool) -> bool:
    """Whether a PNG has a cICP, which stands above all else on colour. PictureError where it says neither sRGB nor, for
    ``linear``, linear light."""
    curve = next((data for kind, data in _chunks(content) if kind == b"cICP"), b"")
    if curve and curve not in ((SRGB, LINEAR) if linear else (SRGB,)):
        raise PictureError(f"its cICP says {', '.join(map(str, curve[:4]))}, that of sRGB is 1, 13, 0, 1")
    return bool(curve)


def bare(content: bytes) -> bytes:
    """A PNG without the chunks that a decoder may leave out (section 4.3): libpng prints what it thinks of each.

    PictureError for a chunk whose checksum is wrong, of which it prints, too.
    """
    kept = [content[:8]]
    at = 8
    for kind, data in _chunks(content):
        end = at + 12 + len(data)
        if kind[:1].isupper():
            if zlib.crc32(kind + data) != int.from_bytes(content[end - 4 : end], "big"):
                raise PictureError("damaged: a checksum of the PNG is wrong")
            kept.append(content[at:end])
        at = end
    return b"".join(kept)


def _chunks(content: bytes) -> Iterator[tuple[bytes, bytes]]:
    at = 8
    while at + 8 <= len(content):
        length = int.from_bytes(content[at : at + 4], "big")
        yield content[at + 4 : at + 8], content[at + 8 : at + 8 + length]
        at += 12 + length


def _inflated(content: bytes, most: int) -> int:
    """Bytes of the pixels once decompressed; those up to a fault, and not many more than ``most``."""
    stream, size = zlib.decompressobj(), 0
    for kind, data in _chunks(content):
        rest = data if kind == b"IDAT" else b""
        try:
            while rest and size < most:
                size += len(stream.decompress(rest, 1 << 20))
                rest = stream.unconsumed_tail
        except zlib.error:
            break
    return size
