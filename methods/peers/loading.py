"""Import the packages of peers, which the extra ``peers`` installs."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any

from ...core.errors import UserError
from ...core.installed import installing


def load(module: str) -> Any:
    """A module of a peer's package. UserError, in one line, where the package is absent or does not start."""
    package = module.partition(".")[0]
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        if error.name != package:
            raise UserError(f"{package} cannot be imported: {error}") from error
        raise UserError(f"{package} is not installed; {installing(extra='peers')}") from error
    except Exception as error:  # whatever a package does when it meets another version of what it needs
        raise UserError(f"{package} cannot be imported: {error}") from error


def unavailable(load_peer: Callable[[], Any]) -> str | None:
    """Why a peer cannot be loaded here, in one line; None if it can."""
    try:
        load_peer()
    except UserError as error:
        return str(error)
    return None
