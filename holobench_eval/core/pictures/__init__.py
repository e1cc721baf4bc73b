"""Pictures from files that anybody may have made: checked by the header first, then decoded without a guess."""

from .stored import LARGEST_PIXELS, Stored, open_picture

__all__ = ["LARGEST_PIXELS", "Stored", "open_picture"]
