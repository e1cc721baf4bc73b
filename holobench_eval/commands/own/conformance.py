"""``holoeval conformance``: the optics and the registration against references of their own, or your propagator."""

from __future__ import annotations

from typing import Annotated

import typer


def conformance(
    propagator: Annotated[
        str | None, typer.Argument(help="Your own, path/to/file.py:Name (docs/propagation.md), in place of ours.")
    ] = None,
) -> None:
    """Check the optics and the registration, or your own propagator: against direct integration, over random poses."""
    from ...testing.propagation_conformance import main as check_optics
    from ...testing.propagator import load_subject

    if propagator is not None:
        raise typer.Exit(check_optics({propagator: load_subject(propagator)}))
    from ...testing.registration_conformance import main as check_registration

    raise typer.Exit(max(check_optics(), check_registration()))
