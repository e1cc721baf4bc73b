"""``holoeval conformance``: the optics and the registration against references of their own."""

from __future__ import annotations

import typer


def conformance() -> None:
    """Check the propagators against direct integration, and registration over random poses of a camera."""
    from ..testing.propagation_conformance import main as check_optics
    from ..testing.registration_conformance import main as check_registration

    raise typer.Exit(max(check_optics(), check_registration()))
