"""The checks of a live bench, made on photographs in a session folder: a linear camera, and the sign of the phase."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import torch
from torch import Tensor

from ...core.errors import UserError
from ...imaging.convention import Convention
from ..exposure import Averaged
from ..preflight import Check, linearity, phase_sign
from .folder import FolderPhotographer
from .frames import find
from .manifest import CHECKS, LETTER, REVERSED, Pattern

NOT_MADE = "checks: not photographed (patterns/checks), so that nobody knows whether the camera is linear"


def bench_checks(photographer: FolderPhotographer) -> list[Check]:
    """What the photographs of the checks say, a line each; one line where there are none of them.

    Photographs of checks that fail may be taken again once the bench is mended.

    UserError for photographs that cannot be used, as in any round.
    """
    patterns = photographer.manifest.of_round(CHECKS)
    if not patterns:  # a session of an earlier version
        return []
    if not any(find(photographer.folder, pattern.capture) for pattern in patterns):
        return [Check(True, NOT_MADE)]
    faults, captures = photographer.check_round(CHECKS)
    if faults:
        raise UserError("checks: nothing was scored. " + " | ".join(faults))
    checks = [*_linear(photographer, patterns), _sign(photographer, patterns)]
    if all(check.passed for check in checks):
        photographer.accept(captures)
    return checks


def _linear(photographer: FolderPhotographer, patterns: list[Pattern]) -> Iterator[Check]:
    colours = range(len(photographer.manifest.wavelengths))
    for colour in colours:
        letters = iter([each for each in patterns if (each.role, each.colour) == (LETTER, colour)])
        if len({each.exposure for each in patterns}) == 1:
            yield Check(True, "linearity: not checked, since the session has one exposure")
            return

        def take(_: float, letters: Iterator[Pattern] = letters) -> Averaged:
            pattern = next(letters)
            counts = photographer.counts(pattern).astype(np.float64)
            return Averaged(counts, np.zeros(counts.shape, dtype=bool), pattern.exposure)

        check = linearity(take, 1.0, photographer.dark_of(CHECKS, colour))
        yield replace(check, line=f"channel {colour}: {check.line}") if len(colours) > 1 else check


def _sign(photographer: FolderPhotographer, patterns: list[Pattern]) -> Check:
    convention = photographer.manifest.phase

    def show(_: Tensor, shown: Convention) -> Tensor:
        role = LETTER if shown.sign == convention.sign else REVERSED
        chosen = {each.colour: each for each in reversed(patterns) if each.role == role and each.exposure == 1.0}
        return torch.stack([torch.from_numpy(photographer.light(chosen[colour])) for colour in sorted(chosen)])

    return phase_sign(show, torch.zeros(()), convention)
