"""Sine and cosine for compiled functions. Numba looks at the date of a caller's file alone: after a change here, the
files of all callers have to be saved, too.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ...core.compiled import compiled

F, N = np.float32, np.int32  # constants of these types keep float32 what it is


@compiled
def sincos(angle: Any) -> tuple[Any, Any]:
    """Sine and cosine of an angle [rad] of a few turns, float32, within 1e-7; without branches, so that it is
    vectorised. The polynomials are Chebyshev fits on an eighth of a turn."""
    quarters = np.rint(angle * F(2 / math.pi))
    x = angle - quarters * F(1.5707855224609375)  # a quarter of a turn in three parts: products with two are exact
    x = x - quarters * F(1.080334186553955e-05)
    x = x - quarters * F(9.920935184e-10)
    q = x * x
    sine = x + x * q * (F(-0.1666666466) + q * (F(0.008332747485) + q * F(-0.0001958770018)))
    cosine = F(1) - F(0.5) * q + q * q * (F(0.04166666466) + q * (F(-0.001388830217) + q * F(2.454773904e-05)))
    n = N(quarters)
    if n & N(1):
        sine, cosine = cosine, sine
    return (-sine if n & N(2) else sine), (-cosine if (n + N(1)) & N(2) else cosine)
