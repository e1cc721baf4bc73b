"""Files as cameras write them."""

from collections.abc import Callable

import pytest

from tests.support import bayer


@pytest.fixture(scope="session")
def bayer_dng() -> Callable[..., bytes]:
    """Makes a DNG of known counts, as a camera with a Bayer mosaic writes it."""
    return bayer.bayer_dng
