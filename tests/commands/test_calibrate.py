import pytest

from holobench_eval.commands import calibrate as command
from holobench_eval.commands.calibrate import UNMODULATED_RANGE, fit
from holobench_eval.core import plugins
from holobench_eval.display import load_profile


def test_the_fit_comes_as_near_as_two_parameters_allow_and_is_printed(monkeypatch, capsys):
    build = plugins.build
    two = {"datasets": {"count": 2}, "methods": {}}
    monkeypatch.setattr(plugins, "build", lambda kind, name, params: build(kind, name, two[kind] | params))
    monkeypatch.setattr(command, "PUBLISHED", {"double_phase": 12.0, "wirtinger": 14.0})
    found = fit(load_profile("leto-mild"), (128, 128), 0)
    assert UNMODULATED_RANGE[0] <= found.fraction <= UNMODULATED_RANGE[1]
    assert found.psnr["wirtinger"] == pytest.approx(14.0, abs=1.5)

    monkeypatch.setattr(command, "fit", lambda *_: found)
    command.calibrate("leto-mild")
    out = capsys.readouterr().out
    assert f"zero_order: {{fraction: {found.fraction}, phase: {found.phase}}}" in out
    assert "wanted 14.00" in out
