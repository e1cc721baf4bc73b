import numpy as np
import pytest

from holobench_eval.report import Results, records_frame
from holobench_eval.report.charts import paired
from holobench_eval.report.charts.look.methods import REGISTRY
from tests.support import budget_study as budget
from tests.support import synthetic_study as synthetic


@pytest.fixture(scope="module")
def found():
    return budget.results()


@pytest.fixture
def drawn(monkeypatch):
    """The figures that are written, as they are before that."""
    figures = []
    monkeypatch.setattr(paired, "save", lambda figure, path: figures.append(figure))
    return figures


def names(axes):
    return [label.get_text() for label in axes.get_yticklabels()]


def marks(axes):
    """The mark of every row, from above to below: a line of one point, without those of the interval's ends."""
    return [line for line in axes.lines if len(line.get_xdata()) == 1 and line.get_zorder() == 5]


def test_every_method_has_a_row_with_its_mark_number_and_dots_and_the_best_stands_first(found, drawn, tmp_path):
    paired.draw(found, "leto-aged", tmp_path / "x.png")
    axes = drawn[0].axes[0]
    gains = {name: found.gain(name, "leto-aged").mean for name in budget.ROWS if name != "wirtinger"}
    assert names(axes)[0] == "oracle"
    assert [name.partition(",")[0].replace("\n", " ") for name in names(axes)] == sorted(gains, key=gains.get)[::-1]
    assert [float(line.get_xdata()[0]) for line in marks(axes)] == pytest.approx(sorted(gains.values())[::-1])
    row = names(axes).index("hil")
    assert (marks(axes)[row].get_markeredgecolor(), marks(axes)[row].get_marker()) == REGISTRY["hil"]
    assert axes.texts[row].get_text() == found.headline.estimate(found.gain("hil", "leto-aged"), signed=True)
    # a dot is the difference of one target, at the same height in every row
    dots = [collection.get_offsets() for collection in axes.collections]
    dots = [offsets for offsets in dots if len(offsets) == len(budget.TARGETS)]
    assert len(dots) == len(budget.ROWS) - 1
    expected = found.values("oracle", "leto-aged") - found.values("wirtinger", "leto-aged")
    assert np.asarray(dots[0][:, 0]) == pytest.approx(expected)
    assert np.asarray(dots[1][:, 1] - 1) == pytest.approx(np.asarray(dots[0][:, 1]))


def test_the_line_at_zero_is_the_baseline_and_a_constant_image_has_one(found, tmp_path, monkeypatch, drawn):
    monkeypatch.setattr(Results, "floor", lambda self, _, less: (self.values("oracle", "leto-aged") - less).mean())
    paired.draw(found, "leto-aged", tmp_path / "x.png")
    handles, labels = drawn[0].axes[0].get_legend_handles_labels()
    places = [float(line.get_xdata()[0]) for line in handles]
    assert places == pytest.approx([0, found.gain("oracle", "leto-aged").mean])
    assert labels[0] == "baseline: wirtinger"
    assert "constant image, +" in labels[1]


def test_a_hole_is_counted_in_the_name_of_its_row(drawn, tmp_path):
    records = budget.study()
    lost = next(i for i, record in enumerate(records) if record["label"] == "hil")
    records[lost] = records[lost] | {"state": "failed", "scores": {}}
    layout = budget.layout()
    paired.draw(Results(records_frame(records, layout), layout), "leto-aged", tmp_path / "x.png")
    assert f"hil, {len(budget.TARGETS) - 1} of {len(budget.TARGETS)} targets" in names(drawn[0].axes[0])


def test_without_a_baseline_nothing_is_drawn():
    assert not paired.displays(budget.results(baseline=None))


def test_a_name_full_of_mathematics_stays_text(tmp_path):
    evil = r"$\frac{a}{0}$ <b>"
    records = [
        synthetic.record(label, synthetic.cell(name, target, "leto-aged"), {"psnr_linear": value})
        for label, name, value in ((evil, "mine.py:Evil", 20.0), ("Wirtinger", "wirtinger", 19.0))
        for target in ("coffee", "rocket")
    ]
    paired.draw(synthetic.results(records), "leto-aged", tmp_path / "x.png")
    assert (tmp_path / "x.png").stat().st_size > 2000
