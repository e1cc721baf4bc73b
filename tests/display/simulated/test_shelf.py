"""Displays of installed packages."""

import pytest

from holobench_eval.commands.displays import displays
from holobench_eval.commands.list_ import list_
from holobench_eval.commands.schema import study_schema
from holobench_eval.core.errors import UserError
from holobench_eval.display import load_profile
from holobench_eval.display.simulated.profile import names
from holobench_eval.display.simulated.shelf import installed, shelves
from holobench_eval.report.site import write_site
from holobench_eval.study.config import load_study
from tests.support import synthetic_study as synthetic
from tests.support.results_folder import TARGETS, write_results

MINE = "like: {like}\nname: {name}\ndescription: A display of lab X.\n"


@pytest.fixture
def install(tmp_path, monkeypatch):
    """Install a package with displays, as pip leaves it; its code must not run."""
    monkeypatch.syspath_prepend(tmp_path)

    def make(package, **profiles):
        folder, described = tmp_path / package / "benches", tmp_path / f"{package}-1.2.dist-info"
        folder.mkdir(parents=True)
        described.mkdir()
        (tmp_path / package / "__init__.py").write_text("raise SystemExit")
        for name, text in profiles.items():
            (folder / f"{name}.yaml").write_text(text)
        (described / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.2\n")
        (described / "entry_points.txt").write_text(f"[holobench_eval.displays]\nlab-x = {package}.benches\n")
        shelves.cache_clear()
        return folder

    yield make
    shelves.cache_clear()


def test_a_display_of_an_installed_package_is_named_everywhere_and_is_that_file(install, tmp_path, capsys):
    folder = install("lab_x", bench=MINE.format(like="base.yaml", name="x"), base=MINE.format(like="ideal", name="b"))
    assert installed() == ["lab-x/base", "lab-x/bench"]
    assert load_profile("lab-x/bench").digest == load_profile(str(folder / "bench.yaml")).digest
    (tmp_path / "study.yaml").write_text(
        "title: On two\ndisplay: {profiles: [ideal, lab-x/bench], panel: [192, 192]}\n"
        "targets: {dataset: charts, params: {names: [tv_lines]}}\nmethods: [double_phase]\n"
    )
    assert load_study(tmp_path / "study.yaml").display.sources == ("ideal", "lab-x/bench")
    assert "lab-x/bench" in str(study_schema()["$defs"]["DisplayGrid"]["properties"]["profiles"])
    list_("lab-x/bench")
    assert "holoeval show lab-x/bench" in capsys.readouterr().out


def test_the_list_has_a_line_for_each_display_with_its_panel_and_origin(install, tmp_path, capsys):
    install("lab_x", bench=MINE.format(like="pluto-fourier", name="x"), broken="name: 3")
    (tmp_path / "own").mkdir()
    (tmp_path / "own" / "mine.yaml").write_text(MINE.format(like="plm-4bit", name="x") + "panel: {shape: [400, 600]}\n")
    displays([tmp_path / "own"])
    _, *lines = capsys.readouterr().out.splitlines()
    of = {line.split()[0]: " ".join(line.split()[1:]) for line in lines}
    own = str(tmp_path / "own" / "mine.yaml")
    assert list(of) == [*names(), *names(family=True), "lab-x/bench", "lab-x/broken", own]
    assert of["lab-x/bench"] == "1080 x 1920 of 8 um, 8 bit, gray no lab_x 1.2 A display of lab X."
    assert "broken.yaml:1:7: name should be" in of["lab-x/broken"]
    assert of[own].startswith("400 x 600 of 10.8 um, 4 bit, 3 colours no a file A display of lab X. ('lab-x/bench' is")
    with pytest.raises(UserError, match="no profile"):
        displays([tmp_path])


def test_the_site_has_a_card_of_an_installed_display_by_its_name_and_words(install, tmp_path):
    trust = "twin: {of: leto-aged, photographs: 59, pictures: 8, gap: {wirtinger: 1.0}, flattery: 0.7}\n"
    install("lab_x", bench=MINE.format(like="leto-aged", name="leto-aged") + trust)
    records = synthetic.study(tmp_path / "study", size=16, targets=TARGETS)
    digests = {"leto-aged": load_profile("lab-x/bench").digest, "ideal": load_profile("ideal").digest}
    known = {"profiles": {name: {"version": 1, "sha256": sha256} for name, sha256 in digests.items()}}
    write_site([write_results(tmp_path / "ours", records, known=known)], tmp_path / "site")
    page = (tmp_path / "site" / "index.html").read_text()
    assert "<h2>lab-x/bench</h2>\n<p>A display of lab X. It is a twin of leto-aged, trained with 59 photographs" in page


def test_names_of_no_display_and_of_two_packages_are_one_line(install):
    with pytest.raises(UserError, match=r"unknown profile 'lab-x/bench'; allowed: flc-1bit"):
        load_profile("lab-x/bench")
    install("lab_x", bench=MINE.format(like="ideal", name="x"))
    with pytest.raises(UserError, match=r"the package lab_x 1\.2 has no display 'bunch'; did you mean 'bench'"):
        load_profile("lab-x/bunch")
    with pytest.raises(UserError, match=r"unknown profile 'bench'; .*lab-x/bench"):
        load_profile("bench")
    install("lab_y", bench=MINE.format(like="ideal", name="y"))
    with pytest.raises(UserError, match=r"lab_x 1\.2 \(.*lab_x/benches\) and lab_y 1\.2 \(.*benches\) are both"):
        load_profile("lab-x/bench")
    assert load_profile("ideal").name == "ideal"  # whatever is installed beside it


def test_a_package_without_its_folder_has_no_displays(install):
    install("lab_x").rmdir()
    shelves.cache_clear()
    assert installed() == []
    assert shelves()["lab-x"].folder is None
