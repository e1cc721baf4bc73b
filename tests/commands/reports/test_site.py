from pathlib import Path

from tests.support import synthetic_study as synthetic
from tests.support.results_folder import TARGETS, write_results


def test_the_reports_of_the_folder_make_a_site(tmp_path, monkeypatch, call):
    monkeypatch.chdir(tmp_path)
    write_results(Path("reports/one"), synthetic.study(tmp_path / "study", size=16, targets=TARGETS))
    Path("reports/timings").mkdir()
    code, printed, _ = call("site")
    assert code == 0
    assert "reports/timings: no records.csv, left out" in printed
    assert "site/index.html: 1 study" in printed
    assert "timings: no records.csv, left out" in Path("site/index.html").read_text()
    assert call("site", "reports", "--output", "site")[0] == 0  # an earlier site is replaced


def test_bad_input_is_one_line_and_exit_code_2(tmp_path, monkeypatch, call):
    monkeypatch.chdir(tmp_path)
    for folder, message in (
        ("nowhere", "nowhere: no such folder; expected a report, or a folder of reports"),
        (".", ".: no report in it; expected records.csv, here or a level below"),
    ):
        code, _, error = call("site", folder)
        assert (code, error.count("\n")) == (2, 1)
        assert message in error
    assert not Path("site").exists()
