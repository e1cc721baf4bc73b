from dataclasses import replace

import pytest

from holobench_eval.core.errors import CellError, UserError
from holobench_eval.display import load_profile
from holobench_eval.display.resolution import refuse_far
from holobench_eval.display.simulated.profile import names
from holobench_eval.study.opening import open_bench


def far(distance, panel):
    profile = load_profile("ideal")
    return replace(profile, panel=replace(profile.panel, distance=distance)).scaled(panel)


def test_a_distance_that_is_refused_registers_no_camera_and_the_one_that_is_named_does():
    panel = (128, 128)
    with pytest.raises(UserError, match=r"2 m, is too far for 128 x 128 pixels: they resolve 29 px") as refused:
        refuse_far(far(2.0, panel).spec(), 2.0)
    with pytest.raises(CellError):
        _ = open_bench(far(2.0, panel)).registration
    limit = float(str(refused.value).split("up to ")[1].split(" m")[0])
    refuse_far(far(0.95 * limit, panel).spec(), 0.95 * limit)
    assert max(open_bench(far(0.8 * limit, panel)).registration.residual) < 0.3


def test_no_display_that_ships_is_too_far():
    for profile in map(load_profile, names()):
        for panel in ((120, 120), (256, 256), None):
            refuse_far(profile.spec(panel), profile.panel.distance)
