"""What ``holoeval list`` says of a single name."""

import contextlib
import io
import os
import re
import subprocess
import sys
from functools import cache, partial
from pathlib import Path

import pytest

from holobench_eval.commands.configs import configs
from holobench_eval.commands.displays import displays
from holobench_eval.commands.list_ import KINDS, list_
from holobench_eval.core import plugins
from holobench_eval.core.errors import UserError
from holobench_eval.core.parameters import parameters


def test_configs_lists_every_study_that_ships(capsys):
    configs()
    printed = capsys.readouterr().out
    assert all(f" {file.stem} " in printed for file in Path("configs").glob("*.yaml"))


def test_functions_of_a_file_are_shown_with_their_parameters_if_they_have_any(tmp_path, capsys):
    lines = ["def solve(target, bench, steps: int = 3):", '    """A flat phase.', "", "    steps: how many", '    """']
    lines += ["def flat(target, bench):", '    """A flat phase."""']
    (tmp_path / "mine.py").write_text("\n".join(lines))
    list_(f"{tmp_path}/mine.py:solve")
    text = " ".join(capsys.readouterr().out.split())
    assert "mine.py:solve, one of the methods A flat phase. " in text
    assert "steps = 3 (whole number) how many" in text
    list_(f"{tmp_path}/mine.py:flat")
    text = capsys.readouterr().out
    assert "\nIt has no parameters.\n" in text
    assert "params:" not in text
    with pytest.raises(UserError, match=r"mine\.py has no 'other'; allowed: "):
        list_(f"{tmp_path}/mine.py:other")


@pytest.mark.parametrize("kind", ["methods", "datasets"])
def test_every_parameter_of_what_ships_has_a_meaning(kind):
    for name in plugins.names(kind):
        assert [entry.name for entry in parameters(plugins.find(kind, name)) if not entry.meaning] == [], name


@pytest.fixture(scope="module")
def pages():
    """All that ``holoeval list`` and ``holoeval list NAME`` print, in one line each, without links and paths."""
    found, entries = {}, {kind: list(listed()) for kind, (listed, _) in KINDS.items()}
    with pytest.MonkeyPatch.context() as patch:
        for kind, known in entries.items():  # which every page would load anew
            patch.setitem(KINDS, kind, (partial(iter, known), KINDS[kind][1]))
        for name in (None, *(name for known in entries.values() for name, _ in known)):
            with contextlib.redirect_stdout(io.StringIO()) as printed:
                list_(name)
            found[name or "overview"] = " ".join(word for word in printed.getvalue().split() if word.count("/") < 2)
    return found


@pytest.mark.parametrize("command", ["list", "displays"])
def test_a_list_says_the_same_without_the_libraries_that_compute(command, capsys):
    asked = f"from holobench_eval.commands import app; app([{command!r}], standalone_mode=False); import torch; "
    asked += "print(torch.nn is torch)"
    apart = subprocess.run([sys.executable, "-c", asked], capture_output=True, text=True, check=True, env=os.environ)
    {"list": list_, "displays": partial(displays, None)}[command]()
    *said, stood_in = apart.stdout.splitlines()
    assert (said, stood_in) == (capsys.readouterr().out.splitlines(), "True")


SAID = {
    "wirtinger": ("Source: Chakravarthula, Peng, ", "step = 0.1 (number above 0, at most 10) Adam's step [rad]"),
    "hil": ("is trained first", "retrieval.step = 0.06 (number above 0"),  # HIL's, not the class's own
    "leto-2020": ("Version ", "crosstalk of 0.4687 px", "holoeval show leto-2020"),
    "drift": ("values [days] from 0 to 3650", "dust that settles", "sweeps: [{condition: drift"),
    "draw": ("count: 3",),
    "ssim": ("IEEE Trans. Image Process. 13", "columns: ssim_linear, ssim_amplitude, ssim_srgb"),
    "lpips_alex": ("lower is better", "columns: lpips_alex_srgb"),
    "crops": ("size = 208 (whole number from 32 to 4096) pixels a side",),
    "table3": ("question: Does hil", "run: holoeval run table3"),
    "overview": ("values [mm] from -40 to 40", "complex modulated", "values: canon-t6i or fujifilm-s5-pro"),
}


def test_a_display_says_how_many_frames_it_shows_and_whether_it_is_too_far(tmp_path, capsys):
    list_("flc-1bit")
    assert "up to 8 frames an exposure" in capsys.readouterr().out
    far = tmp_path / "far.yaml"
    far.write_text("name: far\nversion: 1\nseed: 1\ndescription: Far.\nlike: leto-2020\npanel: {distance: 3.0}\n")
    list_(str(far))
    said = " ".join(capsys.readouterr().out.split())
    assert "too far for 256 x 256 pixels" in said
    assert "frames" not in said


@pytest.mark.parametrize("name", SAID)
def test_a_page_says_what_a_name_of_its_kind_needs(pages, name):
    assert [words for words in SAID[name] if words not in pages[name]] == []


def test_everything_that_is_listed_can_be_explained(pages):
    assert [name for name, text in pages.items() if name != "overview" and f"{name}, one of the " not in text] == []


@cache
def keys() -> set[str]:
    """The names of parameters, which a config writes with dots where one lies inside another."""
    kinds: tuple[plugins.Kind, ...] = ("methods", "datasets")
    classes = [plugins.find(kind, name) for kind in kinds for name in plugins.names(kind)]
    return {entry.name for cls in classes for entry in parameters(cls)}


# What a reader of the field knows, or meets outside this package: abbreviations, names of networks, values of a key.
KNOWN = """
PSNR SSIM LPIPS MOFD FLIP LDR GMSD MDSI FSIM VSI SDSP HIL SLM BFGS RGB CPU GPU IEEE ACM CVPR GCPR ICIP CNN VGG DIV2K
 PNG TIFF EXIF MATLAB NTIRE Pix2Pix Pix2PixHD HoloNet HaarPSI ImageNet AlexNet CNNpropCNN PeerJ SHA256SUMS
DIV2K_valid_HR AUTO ASM DIM ASM_FRESNEL DIM_FRESNEL SIGGRAPH CGH
"""


@pytest.mark.parametrize(
    ("what", "pattern"),
    [
        ("marks of markup", r"`|::"),
        ("classes of errors", r"\b\w+Error\b"),
        ("names of constants", r"\b[A-Z][A-Z_]+[A-Z0-9_]+\b"),
        ("names of classes", r"\b[A-Z][a-z0-9]+[A-Z]\w*"),
        ("names of functions", r"(?<![\w.])[a-z]\w*(?:\.[a-z_]\w*)+(?!\w)|\b\w+\(\)"),
        ("pointers into the code", r"\b[Ss]ee (?!through)\w+"),
    ],
)
def test_what_is_listed_says_things_without_names_of_the_code(pages, what, pattern):
    file = re.compile(r".*\.(?:png|tif|bmp|np[yz]|mat|jpg|zip|yaml)")
    said = {
        f"{page}: {word}"
        for page, text in pages.items()
        for word in re.findall(pattern, text)
        if word not in KNOWN.split() and word not in keys() and not file.fullmatch(word)
    }
    assert said == set(), what


def test_a_value_ends_with_its_own_paragraph(pages):
    assert "lpips_alex: no" not in pages["overview"]
    sixteen_bit = pages["folder"].partition("sixteen_bit =")[2]
    assert sixteen_bit.endswith("linear light")  # not the paragraphs that follow it in the docstring


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("wirtinker", "unknown name 'wirtinker'; did you mean 'wirtinger'?"),
        ("leto2020", "unknown name 'leto2020'; did you mean 'leto-2020'?"),
        ("leto", "unknown name 'leto'; names with it: leto-2020, leto-2020-01, "),
        ("condition", "unknown kind 'condition'; did you mean 'conditions'?"),
        ("?", "unknown kind '?'; allowed: conditions, datasets, methods, metrics, profiles, studies, or a name that"),
    ],
)
def test_an_unknown_name_gets_the_nearest(name, message):
    with pytest.raises(UserError, match=f"^{re.escape(message)}"):
        list_(name)
