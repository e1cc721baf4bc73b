import re
from dataclasses import replace

import pytest

from holobench_eval.commands.own.new import display_text, write_display
from holobench_eval.core.errors import UserError
from holobench_eval.core.parameters import parameters
from holobench_eval.display import load_profile
from holobench_eval.display.simulated.profile import Profile
from holobench_eval.display.simulated.stages import PixelAperture


def test_a_new_display_is_the_panel_that_it_starts_from_with_all_else_off(tmp_path):
    write_display("mine", tmp_path)
    profile = load_profile(str(tmp_path / "mine.yaml"))
    assert profile.panel == load_profile("ideal").panel
    plain = Profile("mine", 1, 0, "A display of my own.", profile.panel, digest=profile.digest)
    assert profile == plain


def test_a_new_display_names_every_key_and_loads_with_all_of_them(tmp_path):
    text = display_text("mine")
    for parameter in parameters(Profile):
        key = parameter.name.rpartition(".")[2]
        assert re.search(rf"^(# )?( *){key}:", text, re.MULTILINE), parameter.name
    start = text.index("# sampling")  # the first key that may be left out, without its words
    path = tmp_path / "mine.yaml"
    path.write_text(text[:start] + re.sub(r"^# ", "", text[start:], flags=re.MULTILINE))
    path.with_name("plain.yaml").write_text(text)
    plain = load_profile(str(path.with_name("plain.yaml")))
    full = load_profile(str(path))
    assert full == replace(plain, aperture=PixelAperture(), digest=full.digest)


@pytest.mark.parametrize(
    ("name", "says"),
    [("my display", "no name for a display"), ("ideal", "a display that ships"), ("mine", "exists already")],
)
def test_a_name_that_cannot_be_is_one_line_and_writes_nothing(tmp_path, name, says):
    (tmp_path / "mine.yaml").write_text("own: work\n")
    with pytest.raises(UserError, match=says):
        write_display(name, tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["mine.yaml"]
    assert (tmp_path / "mine.yaml").read_text() == "own: work\n"
