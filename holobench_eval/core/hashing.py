"""Plain descriptions, and the hashes that name what they describe."""

from __future__ import annotations

import hashlib
import json
from typing import Any

from .errors import UserError


def canonical(description: Any) -> str:
    """JSON text that depends on the content only: sorted keys, no spaces, ASCII, finite numbers."""
    try:
        return json.dumps(description, sort_keys=True, separators=(",", ":"), ensure_ascii=True, allow_nan=False)
    except (TypeError, ValueError) as error:
        raise UserError(f"not a plain description: {error}; use text, finite numbers, lists and mappings") from error


def digest(description: Any) -> str:
    """sha256 of the canonical text, 64 hexadecimal digits."""
    return hashlib.sha256(canonical(description).encode()).hexdigest()
