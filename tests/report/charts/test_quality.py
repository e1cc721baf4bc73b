import pytest
from skimage.io import imread

from holobench_eval.report import Results, records_frame
from holobench_eval.report.charts import quality
from holobench_eval.study.plan import REFERENCE
from tests.support import budget_study as budget
from tests.support import synthetic_study as synthetic


@pytest.fixture(scope="module")
def found():
    layout, name = budget.layout(), "floor_constant"
    floor = [
        synthetic.record(name, synthetic.cell(name, target, REFERENCE), {"psnr_linear": 12.5})
        for target in budget.TARGETS
    ]
    return Results(records_frame([*budget.study(), *floor], layout), layout)


def test_every_display_has_a_panel_with_its_methods_by_their_means_and_the_floor(found, tmp_path, monkeypatch):
    figures = []
    monkeypatch.setattr(quality, "save", lambda figure, path: figures.append(figure))
    quality.draw_quality(tmp_path / "x.png", found, ["floor_constant"])
    panels = figures[0].axes
    assert [axes.get_title(loc="left") for axes in panels] == found.conditions
    for axes, condition in zip(panels, found.conditions, strict=True):
        means = [float(line.get_xdata()[0]) for line in axes.lines if line.get_zorder() == 5]
        assert len(means) == len(budget.ROWS)
        assert means == sorted(means, reverse=True)
        assert max(means) == pytest.approx(found.values("oracle", condition).mean())
        assert [list(line.get_xdata()) for line in axes.lines if line.get_zorder() == 1] == [[12.5, 12.5]]
        words = [text.get_text() for text in axes.texts]
        assert words[0] == found.headline.estimate(found.estimate(found.values("oracle", condition)))


def test_a_study_of_many_methods_is_as_wide_as_any_other(found, tmp_path):
    quality.draw_quality(tmp_path / "x.png", found, [])
    height, width = imread(tmp_path / "x.png").shape[:2]
    assert width == 900
    assert height > 2 * len(budget.ROWS) * quality.ROW
