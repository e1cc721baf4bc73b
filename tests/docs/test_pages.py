"""Pages and tables of the documentation are what the code and the committed reports say."""

import re

import pandas as pd
import pytest

from holobench_eval.core.parameters import parameters
from holobench_eval.display.api import DisplaySpec
from holobench_eval.display.metered import MeteredDisplay
from holobench_eval.display.simulated.profile import Profile
from holobench_eval.display.training import TrainingBench
from tests.docs import config_page, display_page
from tests.docs.boards import BLOCK, PAGE, ROOT, SHOWN, drawn

OWN = {"simulation", "seed", "known", "journal"}  # of a handle: what the harness and the oracle use
WORDS = {"name", "version", "seed", "description", "like"}  # keys of no quantity


def test_the_table_of_the_first_page_is_drawn_from_its_report() -> None:
    text = PAGE.read_text(encoding="utf-8")
    assert BLOCK.search(text)
    assert drawn(text) == text, "draw it: python -m tests.docs.boards"


def test_the_first_page_has_five_rows_a_display_sorted_and_those_of_its_picture() -> None:
    (text,) = (match[0] for match in BLOCK.finditer(PAGE.read_text(encoding="utf-8")))
    rows = [line.split(" | ") for line in text.splitlines() if "<sub>" in line]
    scores = [float(row[3]) for row in rows]
    assert len(rows) == 5 * sum("**" in row[0] for row in rows)
    assert all(scores[at : at + 5] == sorted(scores[at : at + 5], reverse=True) for at in range(0, len(rows), 5))
    assert all(f"<sub>{method}</sub>" in " ".join(row[1] for row in rows[:5]) for method in SHOWN)


def test_the_page_on_configs_is_that_of_their_schema() -> None:
    assert config_page.PAGE.read_text(encoding="utf-8") == config_page.page(), (
        f"write it: python -m {config_page.__name__}"
    )


def test_the_page_on_displays_has_the_place_of_its_tables() -> None:
    assert display_page.PAGE.read_text(encoding="utf-8").count(display_page.MARK) == 1


@pytest.mark.parametrize("handle", [MeteredDisplay, TrainingBench, DisplaySpec])
def test_the_page_on_python_names_all_that_a_method_sees(handle: type) -> None:
    text = (ROOT / "docs" / "start" / "python.md").read_text(encoding="utf-8")
    names = {*vars(handle), *getattr(handle, "__dataclass_fields__", ())} - OWN
    assert sorted(name for name in names if name[0] != "_" and not re.search(rf"`{name}\b", text)) == []


def test_every_key_of_a_display_has_a_row_and_every_quantity_a_unit() -> None:
    text = display_page.tables()
    for parameter in parameters(Profile):
        *_, key = parameter.name.split(".")
        assert f"\n| `{key}` |" in text, parameter.name
        if "number" in parameter.allowed and key not in WORDS:
            assert re.search(r"\[[^\]]+\]", parameter.meaning), parameter.name


def test_every_stage_has_its_model_with_its_source() -> None:
    text = display_page.tables()
    assert "Crosstalk: Gaussian convolution of the phase on sub-samples" in text
    assert text.count("(paper") > 10


def test_the_examples_with_pandas_print_differences_and_tests(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    text = (ROOT / "docs" / "start" / "reading-a-report.md").read_text(encoding="utf-8")
    monkeypatch.chdir(ROOT)
    printed = []
    for example in re.findall(r"<!-- pandas -->\n```python\n(.*?)```", text, re.DOTALL):
        exec(example, {})
        printed.append(capsys.readouterr().out)
    differences, rows = printed
    tests = pd.read_csv("reports/board/tests.csv").query("label == 'hil'").set_index("condition")
    for condition, difference in tests["difference_db"].items():
        (value,) = re.findall(rf"^{condition}\s+(\S+)$", differences, re.MULTILINE)
        assert float(value) == pytest.approx(difference, abs=2e-5)
    assert [line.split()[1] for line in rows.splitlines() if re.match(r"\d", line)] == tests.index.tolist()


def means(study: str) -> dict[tuple[str, str], float]:
    """PSNR of a committed report, by label and condition."""
    rows = pd.read_csv(ROOT / "reports" / study / "table.csv")
    return dict(zip(zip(rows["label"], rows["condition"], strict=True), rows["psnr_linear_db"], strict=True))


def test_numbers_that_pages_quote_are_those_of_reports() -> None:
    first, reading = (
        " ".join((ROOT / page).read_text(encoding="utf-8").split())
        for page in ("README.md", "docs/start/reading-a-report.md")
    )
    board, moved = means("board"), means("robustness")
    aged, near, levels = (
        {label: board[label, display] for label, condition in board if condition == display}
        for display in ("leto-aged", "leto-2020", "plm-4bit")
    )
    known, lost = levels["nearest_level"], moved["hil_plus", "leto-2020"]
    assert f"{aged['twin']:.1f} dB through a twin, and the other {near['twin']:.1f}?" in first
    assert (
        f"it has {known:.1f} dB, `hil` {known - levels['hil']:.1f} dB less, a twin {levels['twin'] - known:.1f}"
        in first
    )
    assert f"on `leto-aged` {aged['parametric_model'] - aged['hil_plus']:.1f} dB better" in first
    assert all(abs(each["parametric_model"] - each["hil_plus"]) < 0.1 for each in (near, levels))
    assert f"costs `hil_plus` [{lost - moved['hil_plus', 'leto-2020, camera shift x -40 mm']:.1f} dB]" in first
    tests = pd.read_csv(ROOT / "reports" / "table3" / "tests.csv").set_index("label").loc["hybrid_model"]
    mean, low, high = tests[["difference_db", "difference_lo_db", "difference_hi_db"]]
    assert f"`hybrid_model` has {means('table3')['hybrid_model', 'leto-2020']:.2f} dB" in reading
    assert f"**{mean:+.2f} dB [{low:+.2f}, {high:+.2f}]**" in reading
