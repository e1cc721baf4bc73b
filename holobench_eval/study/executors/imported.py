"""What workers need beside the package, imported before they are forked; nothing is computed here."""

from contextlib import suppress
from importlib import import_module

from ...optics.transfer import kernel

kernel()
with suppress(ImportError):
    import_module("torch._dynamo")  # by torch's optimisers at their first use, which takes more than a second
