"""What a peer that is not installed does, wherever these tests run."""

import sys

import pytest

from holobench_eval.commands.list_ import KINDS
from holobench_eval.core import plugins
from holobench_eval.core.errors import UserError
from holobench_eval.methods.peers.loading import load


def hide(package: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let every import of a package fail as it does where it is not installed."""

    class Absent:
        def find_spec(self, name: str, path: object = None, target: object = None) -> None:
            if name.partition(".")[0] == package:
                raise ModuleNotFoundError(f"No module named '{name}'", name=package)

    for name in [name for name in sys.modules if name.partition(".")[0] == package]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setattr(sys, "meta_path", [Absent(), *sys.meta_path])


@pytest.mark.parametrize(("name", "package"), [("odak_sgd", "odak"), ("torchoptics_adam", "torchoptics")])
def test_it_is_listed_and_built_and_says_in_one_line_what_to_install(name, package, monkeypatch, bench, scene):
    from holobench_eval.methods.peers import odak_sgd

    odak_sgd._odak.cache_clear()
    hide(package, monkeypatch)
    assert "needs the extra 'peers'" in dict(KINDS["methods"][0]())[name]
    method = plugins.build("methods", name, {})
    why = method.available()
    assert why.startswith(f"{package} is not installed; pip install -c ")
    assert why.endswith("[peers]'")
    with pytest.raises(UserError, match="is not installed"):
        method.solve(scene(), bench)


def test_a_package_that_lacks_one_of_its_own_says_which(tmp_path, monkeypatch):
    (tmp_path / "halfpeer.py").write_text("import nothing_of_this_name\n")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(UserError, match=r"^halfpeer cannot be imported: No module named 'nothing_of_this_name'$"):
        load("halfpeer")
