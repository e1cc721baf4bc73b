from collections import defaultdict

import matplotlib.axes
import numpy as np
import pytest
from matplotlib.transforms import Bbox
from skimage.io import imread

from holobench_eval.report import Results, records_frame
from holobench_eval.report.charts.frontier import Costs, Frontier, Mark, draw_frontiers
from holobench_eval.report.charts.labels import Names
from holobench_eval.report.charts.look.methods import look
from holobench_eval.report.charts.style import new_figure
from holobench_eval.report.sections.cost import draw
from tests.support import budget_study as budget

NAN = float("nan")


LOOKED = defaultdict(lambda: look("sgd"))


def mark(label, cost, quality, category="calibrated", group="", captures=None):
    spent = cost if captures is None else captures
    return Mark(label, group or label, category, cost, quality, quality - 0.5, quality + 0.5, spent)


@pytest.fixture(scope="module")
def found():
    layout = budget.layout()
    return Results(records_frame(budget.study(), layout), layout)


@pytest.fixture
def drawn(monkeypatch):
    """What the panels are drawn with: the names that were placed and the axes they stand in."""
    seen = []
    settle = Names._settle

    def watch(self, annotation, middle, width, height):
        settle(self, annotation, middle, width, height)
        seen.append((annotation.get_text(), self.taken[-1], self.axes))

    monkeypatch.setattr(Names, "_settle", watch)
    return seen


def overlaps(boxes):
    return [
        (a, b)
        for i, (a, first) in enumerate(boxes)
        for b, second in boxes[i + 1 :]
        if Bbox.intersection(first, second) is not None
        and min(Bbox.intersection(first, second).width, Bbox.intersection(first, second).height) > 0.5
    ]


def test_no_two_names_overlap_and_none_leaves_its_panel(found, tmp_path, drawn):
    files = list(draw(found, tmp_path))
    assert [path.name for path, _ in files] == ["quality-captures.png", "quality-time.png"]
    for axes in {axes for *_, axes in drawn}:
        names = [(text, box) for text, box, where in drawn if where is axes]
        assert len(names) == 11 + 2  # eleven rows, floor and oracle
        assert overlaps(names) == []
        assert all(axes.bbox.x0 <= box.x0 and box.x1 <= axes.bbox.x1 for _, box in names)
    for path, _ in files:
        picture = imread(path)
        assert picture.shape[1] == 900
        assert len({tuple(pixel) for pixel in picture[::5, ::5].reshape(-1, picture.shape[2])}) > 20


def test_rows_of_one_method_are_joined_by_their_captures_and_named_once(tmp_path, drawn, monkeypatch):
    lines = []
    plot = matplotlib.axes.Axes.plot
    monkeypatch.setattr(
        matplotlib.axes.Axes, "plot", lambda self, *given, **k: lines.append(given) or plot(self, *given, **k)
    )
    same = [mark(str(cost), cost, quality, group="m.py:Same") for cost, quality in ((100, 22), (10, 20), (30, 21))]
    marks = (*same, mark("other", 10, 21))
    draw_frontiers(tmp_path / "x.png", [Frontier("bench", marks)], "PSNR [dB]", "captures", LOOKED)
    assert [text for text, *_ in drawn] == ["Same", "other"]
    joined = [given for given in lines if list(given[1]) == [20, 21, 22]]
    assert len(joined) == 1
    assert joined[0][0] == pytest.approx([1, 1.4771, 2], rel=1e-4)


def test_variants_that_differ_in_something_else_than_captures_are_not_joined(tmp_path, drawn, monkeypatch):
    lines = []
    plot = matplotlib.axes.Axes.plot
    monkeypatch.setattr(
        matplotlib.axes.Axes, "plot", lambda self, *given, **k: lines.append(given) or plot(self, *given, **k)
    )
    seconds = {"no L1": (3, 20), "no L2": (10, 22), "no start": (30, 21)}
    marks = tuple(mark(label, *where, group="hil", captures=88) for label, where in seconds.items())
    draw_frontiers(tmp_path / "x.png", [Frontier("bench", marks)], "PSNR [dB]", "seconds", LOOKED)
    assert not [given for given in lines if list(given[1]) == [20, 22, 21]]
    assert sorted(text for text, *_ in drawn) == sorted(seconds)


def test_variants_that_stand_side_by_side_share_a_name(tmp_path, drawn):
    crowd = [mark(f"variant {number}", 10 + number / 50, 20, group="hil", captures=88) for number in range(6)]
    marks = (*crowd, mark("apart", 100, 15, group="hil", captures=88))
    draw_frontiers(tmp_path / "x.png", [Frontier("bench", marks)], "PSNR [dB]", "seconds", LOOKED)
    assert sorted(text for text, *_ in drawn) == ["apart", "hil, 6 variants"]


def test_two_rows_of_one_method_are_each_named(tmp_path, drawn):
    marks = (mark("wirtinger", 3, 17, group="w"), mark("wirtinger, no offset", 2.9, 19, group="w"))
    draw_frontiers(tmp_path / "x.png", [Frontier("bench", marks)], "PSNR [dB]", "seconds", LOOKED)
    assert sorted(text for text, *_ in drawn) == ["wirtinger", "wirtinger, no offset"]


def test_rows_of_one_method_that_cost_the_same_are_each_named(tmp_path, drawn):
    marks = (mark("short", 0, 20, group="w"), mark("long", 0, 21, group="w"), mark("other", 10, 21))
    draw_frontiers(tmp_path / "x.png", [Frontier("bench", marks)], "PSNR [dB]", "captures", LOOKED)
    assert sorted(text for text, *_ in drawn) == ["long", "other", "short"]


def test_zero_captures_stand_left_of_the_logarithmic_part_side_by_side():
    free = [mark("a", 0, 20), mark("b", 0, 20)]
    costs = Costs.of([*free, mark("c", 16, 22), mark("d", 600, 23)])
    places = [costs.position(one) for one in free]
    assert places[0] < places[1] < costs.low < np.log10(16)
    assert costs.zero == pytest.approx(sum(places) / 2)
    assert costs.limits[0] < places[0]
    assert Costs.of([mark("c", 16, 22)]).zero is None


@pytest.mark.parametrize(
    ("most", "expected"),
    [
        (600, ["0", "20", "50", "100", "200", "500", "1,000"]),
        (9000, ["0", "100", "1,000", "10,000"]),
        (24, ["0", "16", "24"]),
    ],
)
def test_the_axis_names_zero_and_round_numbers_with_a_break_between(most, expected):
    axes = new_figure(400, 300).subplots()
    Costs.of([mark("a", 0, 20), mark("c", 16, 22), mark("d", most, 23)]).show(axes)
    axes.figure.canvas.draw()
    assert [label.get_text() for label in axes.get_xticklabels()] == expected
    assert len(axes.lines) == 3  # the gap in the spine and its two strokes


def test_bars_are_paired_with_the_baseline_and_its_own_row_has_none(found, tmp_path, monkeypatch):
    seen = []
    monkeypatch.setattr(
        "holobench_eval.report.sections.cost.draw_frontiers", lambda path, panels, *_: seen.append(panels)
    )
    list(draw(found, tmp_path))
    marks = {one.label: one for one in seen[0][0].marks}
    alone = found.row("learned_kernel", "leto-aged")
    one = marks["learned_kernel"]
    assert one.low < one.quality < one.high
    assert one.high - one.low < 0.6 * (alone["psnr_linear_hi_db"] - alone["psnr_linear_lo_db"])
    gained = found.gain("learned_kernel", "leto-aged")
    assert one.high - one.quality == pytest.approx(gained.high - gained.mean)
    assert np.isnan(marks["wirtinger"].low)
    assert "oracle" not in marks
    assert seen[0][0].oracle.label.startswith("oracle: oracle, ")
    assert seen[0][0].baseline.label.startswith("baseline: wirtinger, ")


def test_a_method_that_lacks_a_target_is_omitted_and_named(tmp_path, monkeypatch):
    seen = []
    monkeypatch.setattr(
        "holobench_eval.report.sections.cost.draw_frontiers", lambda path, panels, *_: seen.append(panels)
    )
    records = budget.study()
    lost = next(i for i, record in enumerate(records) if record["label"] == "hil")
    records[lost] = records[lost] | {"state": "failed", "scores": {}}
    layout = budget.layout()
    captions = [caption for _, caption in draw(Results(records_frame(records, layout), layout), tmp_path)]
    assert all("Omitted where a target is missing: hil." in caption for caption in captions)
    there = [{one.label for one in panel.marks} for panel in seen[0]]
    assert [("hil" in labels, "sgd" in labels) for labels in there] == [(False, True), (True, True)]


def test_without_captures_there_is_no_chart_of_them(tmp_path):
    plain = ("wirtinger", "sgd", "gerchberg_saxton", "double_phase", "oracle")
    layout = budget.layout(
        pairs=tuple((label, "ideal") for label in plain), camera=frozenset(), trained=frozenset(), baseline=None
    )
    kept = [r for r in budget.study() if r["label"] in plain and r["cell"]["condition"] == "ideal"]
    ((path, caption),) = draw(Results(records_frame(kept, layout), layout), tmp_path)
    assert path.name == "quality-time.png"
    assert "Bars: 95 % interval of the mean over targets." in caption
