"""RAW files of known counts, as cameras with a Bayer mosaic write them."""

import io

import numpy as np
import tifffile

RGGB = bytes([0, 1, 1, 2])


def bayer_dng(mosaic: np.ndarray, black: int = 512, white: int = 16383, pattern: bytes = RGGB) -> bytes:
    """The file's bytes for an ``(H, W)`` uint16 mosaic; pattern: the colours of its first 2x2 sites."""
    tags = [
        (271, "s", 0, "Maker", True),
        (272, "s", 0, "Model", True),
        (33421, "H", 2, (2, 2), True),
        (33422, "B", 4, pattern, True),
        (50706, "B", 4, bytes([1, 4, 0, 0]), True),
        (50708, "s", 0, "Maker Model", True),
        (50714, "H", 1, black, True),
        (50717, "H", 1, white, True),
        # a matrix and a white balance that would change every value, were they applied
        (50721, "2i", 9, (2, 1, -1, 2, 0, 1, -1, 2, 3, 2, 0, 1, 0, 1, -1, 2, 2, 1), True),
        (50728, "2I", 3, (1, 2, 1, 1, 1, 3), True),
        (50778, "H", 1, 21, True),
    ]
    file = io.BytesIO()
    tifffile.imwrite(file, mosaic, photometric=32803, extratags=tags, metadata=None)
    return file.getvalue()
