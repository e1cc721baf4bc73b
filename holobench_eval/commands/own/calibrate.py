"""``holoeval calibrate``: what published figures say of a display: a fit, or a family of displays near them."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

import typer

from ...core.errors import UserError
from ..options import RESULTS
from ..options import Profile as ProfileName


def calibrate(
    profile: ProfileName,
    draws: Annotated[
        int | None, typer.Option(min=1, help="Draw so many displays of its family, and keep those that fit.")
    ] = None,
    output: Annotated[
        Path | None, typer.Option(help="Folder of the draws. [default: holoeval-results/<profile>-family]")
    ] = None,
    workers: Annotated[int | None, typer.Option(min=1, help="Draws side by side.")] = None,
) -> None:
    """Fit a profile to published figures; with --draws, draw the family of displays near them."""
    if draws is not None:
        _family(profile, draws, output or RESULTS / f"{profile}-family", workers)
        return
    from ...display import load_profile
    from ...study.calibration import load_calibration
    from ...study.calibration.fitting import Fitting
    from ...study.running.progress import watching
    from ..output import console

    screen = console()
    loaded = load_profile(profile)
    calibration = load_calibration(loaded)
    if (output, workers) != (None, None):
        raise UserError("--output and --workers go with --draws")
    with watching(screen) as watch:
        fitting = Fitting(profile, loaded, calibration, watch, lambda line: screen.print(line, soft_wrap=True))
        values, network = fitting.fit()
        psnr = fitting.captured(values)
    rows, columns = calibration.panel
    print(f"\n{loaded.name} on {rows} x {columns} pixels, captured, registered and scored:")
    for method, published in calibration.figures.items():
        print(f"  {method:<14}{psnr[method]:6.2f} dB   wanted {published:.2f}")
    if calibration.prediction is not None:
        print(f"  {'network':<14}{network:6.2f} dB   wanted {calibration.prediction.psnr:.2f}")
    print("write into the profile, and raise its version if they differ:")
    for name, value in values.items():
        print(f"  {name}: {value}")


def _family(name: str, draws: int, folder: Path, workers: int | None) -> None:
    """Draw displays, resuming what the folder has; write the report and the profiles that are kept."""
    from ...report.family import write_family
    from ...study.calibration.family import compute, load_family
    from ...study.calibration.posterior import members, middle, write_member
    from ...study.executors import executor
    from ...study.running.progress import duration, seldom
    from ..output import console

    family, screen, began, is_due = load_family(name), console(), time.monotonic(), seldom()

    def tell(done: int, of: int) -> None:
        if is_due() or done == of:
            left = duration((of - done) * (time.monotonic() - began) / done)
            screen.print(f"{done} of {of} draws, about {left} left")

    rows = compute(name, folder, executor("auto", workers), draws, tell)
    kept = members(family, name, rows, folder)
    for member in kept:
        path = folder / "displays" / f"{member.profile.name}.yaml"
        path.parent.mkdir(exist_ok=True)
        write_member(path, family, member, draws)
        print(path)
    print(write_family(folder, family, rows, kept, middle(family, rows, kept)))
