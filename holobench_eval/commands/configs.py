"""``holoeval configs``: the studies that ship."""

from __future__ import annotations

from .list_ import list_


def configs() -> None:
    """List the studies that ship; every command that takes a config takes the name of one."""
    list_("studies")
