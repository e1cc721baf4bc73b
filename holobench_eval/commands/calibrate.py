"""``holoeval calibrate``: fit the free parameters of a profile to published figures."""

from __future__ import annotations

from .options import Profile as ProfileName


def calibrate(profile: ProfileName) -> None:
    """Fit the free parameters of a profile to published figures; minutes, a quarter of an hour with a network."""
    from ..display import load_profile
    from ..study.calibration import load_calibration
    from ..study.calibration.fitting import Fitting
    from ..study.progress import watching
    from .output import console

    loaded, screen = load_profile(profile), console()
    calibration = load_calibration(loaded)
    with watching(screen) as watch:
        fitting = Fitting(
            profile, loaded, calibration, watch, lambda line: screen.print(line, highlight=False, soft_wrap=True)
        )
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
