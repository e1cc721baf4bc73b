"""The command prints what was fitted, what it gives and what was wanted."""

from holobench_eval.commands.own.calibrate import calibrate
from holobench_eval.study.calibration.fitting import Fitting


def test_figures_and_values_are_printed_beside_what_was_wanted(monkeypatch, capsys):
    monkeypatch.setattr(Fitting, "fit", lambda _: ({"stray_light.share": 0.512}, 25.04))
    monkeypatch.setattr(Fitting, "captured", lambda _, values: {"double_phase": 15.3, "wirtinger": 17.5})
    calibrate("leto-hazy")
    out = capsys.readouterr().out
    assert "double_phase   15.30 dB   wanted 15.24" in out
    assert "network        25.04 dB   wanted 25.10" in out
    assert "stray_light.share: 0.512" in out
