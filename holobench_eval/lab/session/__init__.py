"""An exchange of files with a bench that other software drives: patterns out, photographs in, round by round."""

from .folder import FolderPhotographer, session_photographer
from .manifest import Manifest, Pattern, read_manifest, write_manifest

__all__ = ["FolderPhotographer", "Manifest", "Pattern", "read_manifest", "session_photographer", "write_manifest"]
