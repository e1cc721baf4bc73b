"""Edits of code and files that a method's number depends on, in three layouts, and what a study says after each.

``python -m tests.support.edits [FOLDER]`` runs all of them by ``holoeval run``, and prints those that are wrong.
"""

import csv
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from PIL import Image

BEFORE, AFTER = 0.8125, 0.3125  # of the same length, so that a file keeps its size
SCALED = "import torch\nSEEDED = lambda: torch.Generator().manual_seed(0)\n\n"
SCALED += "\ndef solve(target, bench):\n    return scaled(number(), bench)\n"
SCALED += (
    "\n\ndef scaled(value, bench):\n"
    "    return value if bench is None else value * torch.rand((1, 3, *bench.spec.shape), generator=SEEDED())\n"
)
HELP = "def value():\n    return 0.8125\n"


@dataclass(frozen=True)
class Form:
    """A way in which a number reaches a method.

    body: of its file, with a function ``number``; files: of the library beside it, by name, ``NAME`` being the form's;
    data: the same with bytes; told: whether it cannot be covered, and the study says so; new: a file that the edit
    makes, in the place of all numbers that it exchanges; edits: which files it exchanges them in.
    """

    body: str
    files: dict[str, str] = field(default_factory=dict)
    data: Callable[[Path, float], None] | None = None
    told: bool = False
    new: str = ""


def helped(body: str, text: str = HELP, **further: object) -> Form:
    return Form(body, {"NAME_h.py": text}, **further)  # type: ignore[arg-type]


def data(body: str, text: str = "0.8125", **further: object) -> Form:
    return Form(f"from pathlib import Path\n{body}", {"NAME.txt": text}, **further)  # type: ignore[arg-type]


def number(line: str, top: str = "") -> str:
    return f"{top}\n\ndef number():\n    {line}\n"


def picture(path: Path, value: float) -> None:
    Image.fromarray(np.full((8, 8, 3), round(value * 16), np.uint8)).save(path.with_suffix(".png"))


def array(path: Path, value: float) -> None:
    np.save(path.with_suffix(".npy"), np.full(3, value))


JIT = "from numba import njit\n\n@njit(cache=True)\ndef inner(x):\n    return x * "
TXT = "Path(LIB, 'NAME.txt')"
PNG = "str(Path(LIB, 'NAME.png'))"
FORMS: dict[str, Form] = {
    "constant": Form(number("return 0.8125")),
    "class": Form("class Odd:\n    value = 0.8125\n" + number("return Odd.value")),
    "lambda": Form("value = lambda x=0.8125: x\n" + number("return value()")),
    "import": helped(number("return NAME_h.value()", "import NAME_h")),
    "imported_value": helped(number("return value", "from NAME_h import value"), "value = 0.8125\n"),
    "star": helped(number("return value()", "from NAME_h import *")),
    "lazy": helped(number("import NAME_h; return NAME_h.value()")),
    "composed": helped(number("import importlib; return importlib.import_module('NAME_' + 'h').value()")),
    "runpy": helped(number("import runpy; return runpy.run_path(LIB + '/NAME_h.py')['value']()")),
    "exec": helped(number("space = {}; exec(open(LIB + '/NAME_h.py').read(), space); return space['value']()")),
    "decorator": helped(
        number("return 0", "from NAME_h import scaling").replace("def number", "@scaling\ndef number"),
        "import functools\n\ndef scaling(function):\n    return functools.wraps(function)(lambda: 0.8125)\n",
    ),
    "base_class": helped(
        "from NAME_h import Base\nclass Own(Base): ...\n" + number("return Own.value"),
        "class Base:\n    value = 0.8125\n",
    ),
    "chain": Form(
        number("return NAME_h.value()", "import NAME_h"), {"NAME_h.py": "from NAME_i import value\n", "NAME_i.py": HELP}
    ),
    "chain_lazy": Form(
        number("return NAME_h.value()", "import NAME_h"),
        {"NAME_h.py": "def value():\n    from NAME_i import value\n    return value()\n", "NAME_i.py": HELP},
    ),
    "package": Form(
        number("return value()", "from NAME_p.inner import value"),
        {"NAME_p/__init__.py": "", "NAME_p/inner.py": "from .other import value\n", "NAME_p/other.py": HELP},
    ),
    "namespace": Form(number("return value()", "from NAME_n.inner import value"), {"NAME_n/inner.py": HELP}),
    "module_getattr": helped(
        number("return NAME_h.any", "import NAME_h"), "def __getattr__(name):\n    return 0.8125\n"
    ),
    "partial": helped(number("return FIXED()", "import functools, NAME_h\nFIXED = functools.partial(NAME_h.value)")),
    "data_at_import": data(f"VALUE = float({TXT}.read_text())\n" + number("return VALUE")),
    "data": data(number(f"return float({TXT}.read_text())")),
    "data_in_helper": Form(
        number("return NAME_h.value()", "import NAME_h"),
        {
            "NAME_h.py": "from pathlib import Path\nHERE = Path(__file__).parent\n"
            "V = float((HERE / 'NAME.txt').read_text())\n\ndef value():\n    return V\n",
            "NAME.txt": "0.8125",
        },
    ),
    "resource": Form(
        number("from importlib.resources import files; return float(files('NAME_p').joinpath('v.txt').read_text())"),
        {"NAME_p/__init__.py": "", "NAME_p/v.txt": "0.8125"},
    ),
    "json": data(number(f"import json; return json.loads({TXT}.read_text())")),
    "pandas": data(number(f"import pandas; return float(pandas.read_csv({TXT}, header=None).iloc[0, 0])")),
    "numpy_text": data(number(f"import numpy; return float(numpy.loadtxt({TXT}))")),
    "numpy": Form(
        "from pathlib import Path\n" + number("import numpy; return float(numpy.load(Path(LIB, 'NAME.npy'))[0])"),
        data=array,
    ),
    "memmap": Form(
        "from pathlib import Path\n"
        + number("import numpy; return float(numpy.load(Path(LIB, 'NAME.npy'), mmap_mode='r')[0])"),
        data=array,
    ),
    "pillow": Form(
        "from pathlib import Path\n"
        + number(f"from PIL import Image; return Image.open({PNG}).getpixel((0, 0))[0] / 16"),
        data=picture,
    ),
    "cv2": Form(
        "import cv2\nfrom pathlib import Path\n" + number(f"return float(cv2.imread({PNG})[0, 0, 0]) / 16"),
        data=picture,
    ),
    "kornia_rs": Form(
        "from pathlib import Path\nfrom kornia_rs import read_image_any\n"
        + number(f"return float(read_image_any({PNG})[0, 0, 0]) / 16"),
        data=picture,
    ),
    "kornia_rs_io": Form(
        "from pathlib import Path\n"
        + number(f"import kornia_rs; return float(kornia_rs.io.read_image_png_u8({PNG}, 'rgb')[0, 0, 0]) / 16"),
        data=picture,
    ),
    "os_open": data(number(f"import os; return float(os.read(os.open({TXT}, os.O_RDONLY), 99))")),
    "dir_fd": data(
        number(
            "import os; return float(os.read(os.open('NAME.txt', os.O_RDONLY, dir_fd=os.open(LIB, os.O_RDONLY)), 99))"
        )
    ),
    "fd_listing": Form(
        number("import os; return 0.8125 if len(os.listdir(os.open(LIB + '/NAME_d', os.O_RDONLY))) == 1 else 0.3125"),
        {"NAME_d/a": ""},
        new="NAME_d/b",
    ),
    "listdir": Form(
        number("import os; return 0.8125 if len(os.listdir(LIB + '/NAME_d')) == 1 else 0.3125"),
        {"NAME_d/a": ""},
        new="NAME_d/b",
    ),
    "scandir": Form(
        number("import os; return 0.8125 if len([*os.scandir(LIB + '/NAME_d')]) == 1 else 0.3125"),
        {"NAME_d/a": ""},
        new="NAME_d/b",
    ),
    "glob": Form(
        number("import glob; return 0.8125 if len(glob.glob(LIB + '/NAME_d/*')) == 1 else 0.3125"),
        {"NAME_d/a": ""},
        new="NAME_d/b",
    ),
    "glob_at_import": Form(
        "from pathlib import Path\nFOUND = [*Path(LIB, 'NAME_d').glob('*')]\n"
        + number("return 0.8125 if len(FOUND) == 1 else 0.3125"),
        {"NAME_d/a": ""},
        new="NAME_d/b",
    ),
    "walk": Form(
        number("import os; return 0.8125 if len([*os.walk(LIB + '/NAME_d')][0][2]) == 1 else 0.3125"),
        {"NAME_d/a": ""},
        new="NAME_d/b",
    ),
    "exists": Form(
        "from pathlib import Path\n" + number("return 0.3125 if Path(LIB, 'NAME.new').exists() else 0.8125"),
        new="NAME.new",
    ),
    "os_path_exists": Form(
        number("import os; return 0.3125 if os.path.isfile(LIB + '/NAME.new') else 0.8125"), new="NAME.new"
    ),
    "access": Form(
        number("import os; return 0.3125 if os.access(LIB + '/NAME.new', os.R_OK) else 0.8125"), new="NAME.new"
    ),
    "size": data(number(f"import os; return 0.8125 if os.path.getsize({TXT}) == 6 else 0.3125"), new="NAME.txt"),
    "caught": Form(
        "from pathlib import Path\ndef number():\n    try:\n"
        "        return float(Path(LIB, 'NAME.new').read_text() or 0.3125)\n"
        "    except OSError:\n        return 0.8125\n",
        new="NAME.new",
    ),
    "symlink": data(
        number(
            f"link = Path(LIB, 'NAME.link'); link.unlink(True); link.symlink_to({TXT}); return float(link.read_text())"
        )
    ),
    "sqlite": Form(
        number("import sqlite3; return sqlite3.connect(LIB + '/NAME.db').execute('select value from v').fetchone()[0]"),
        data=lambda path, value: _database(path.with_suffix(".db"), value),
    ),
    "zip": Form(
        number("from zipped_NAME import value; return value()", "import sys\nsys.path.insert(0, LIB + '/NAME.zip')"),
        data=lambda path, value: _zipped(path.with_suffix(".zip"), value),
    ),
    "thread": data(
        "from concurrent.futures import ThreadPoolExecutor\n"
        + number(f"return float(ThreadPoolExecutor().submit(open, {TXT}).result().read())")
    ),
    "numba": Form(
        number("return float(fast.inner(1.0))", "import NAME_f as fast"),
        {
            "NAME_f.py": f"from NAME_h import value\n{JIT}value()\n",
            "NAME_h.py": "from numba import njit\n\n@njit\ndef value():\n    return 0.8125\n",
        },
    ),
    "numba_lazy": Form(
        number("import NAME_f as fast; return float(fast.inner(1.0))"),
        {
            "NAME_f.py": f"from NAME_h import value\n{JIT}value()\n",
            "NAME_h.py": "from numba import njit\n\n@njit\ndef value():\n    return 0.8125\n",
        },
    ),
    "numba_data": data(f"VALUE = float({TXT}.read_text())\n{JIT}VALUE\n" + number("return float(inner(1.0))")),
    "environment": Form(number("import os; return float(os.environ['HOLO_TEST_NUMBER'])"), told=True),
    "environment_at_import": Form(
        "import os\nVALUE = float(os.getenv('HOLO_TEST_NUMBER', '1'))\n" + number("return VALUE"), told=True
    ),
    "environment_numba": Form(
        f"import os\nVALUE = float(os.environ.get('HOLO_TEST_NUMBER'))\n{JIT}VALUE\n"
        + number("return float(inner(1.0))"),
        told=True,
    ),
    "child": data(number(f"import subprocess; return float(subprocess.check_output(['cat', {TXT}]))"), told=True),
    "child_at_import": data(
        f"import subprocess\nVALUE = float(subprocess.check_output(['cat', {TXT}]))\n" + number("return VALUE"),
        told=True,
    ),
    "system": data(number(f"import os; return float(os.popen('cat ' + str({TXT})).read())"), told=True),
}


def _database(path: Path, value: float) -> None:
    import sqlite3

    path.unlink(missing_ok=True)
    with sqlite3.connect(path) as base:
        base.execute("create table v (value real)")
        base.execute("insert into v values (?)", (value,))
    base.close()


def _zipped(path: Path, value: float) -> None:
    import zipfile

    with zipfile.ZipFile(path, "w") as file:
        file.writestr(f"zipped_{path.stem}.py", f"def value():\n    return {value}\n")


LAYOUTS = ("beside", "project", "installed")


@dataclass(frozen=True)
class Place:
    """Where a layout has what. installed: of a package that another folder holds, with entry points."""

    root: Path
    layout: str

    @property
    def config(self) -> Path:
        return self.root / {"beside": "", "project": "configs", "installed": "studies"}[self.layout] / "study.yaml"

    @property
    def methods(self) -> Path:
        return self.root / {"beside": "", "project": "methods", "installed": "package/a_lab"}[self.layout]

    @property
    def library(self) -> Path:
        return self.root / {"beside": "", "project": "lib", "installed": "library"}[self.layout]

    def method(self, name: str) -> str:
        """The name of a form's method in a config."""
        if self.layout == "installed":
            return f"a_lab_{name}"
        return f"{os.path.relpath(self.methods, self.config.parent)}/m_{name}.py:solve"

    def write(self, names: Iterator[str] | list[str]) -> None:
        """Write forms, before their edit."""
        for folder in (self.config.parent, self.methods, self.library):
            folder.mkdir(parents=True, exist_ok=True)
        names = list(names)
        for name in names:
            form = FORMS[name]
            top = f"LIB = {str(self.library)!r}\n"
            if self.layout == "project":
                top = f"import sys\nLIB = {str(self.library)!r}\nsys.path.insert(0, LIB)\n"
            (self.methods / f"m_{name}.py").write_text(top + form.body.replace("NAME", name) + SCALED)
            for file, text in form.files.items():
                path = self.library / file.replace("NAME", name)
                path.parent.mkdir(exist_ok=True)
                path.write_text(text.replace("NAME", name))
            if form.data:
                form.data(self.library / name, BEFORE)
        if self.layout == "installed":
            (self.methods / "__init__.py").write_text("")
            known = self.root / "package" / "a_lab-1.0.dist-info"
            known.mkdir(exist_ok=True)
            (known / "METADATA").write_text("Metadata-Version: 2.1\nName: a-lab\nVersion: 1.0\n")
            points = "".join(f"a_lab_{name} = a_lab.m_{name}:solve\n" for name in names)
            (known / "entry_points.txt").write_text(f"[holobench_eval.methods]\n{points}")

    def edit(self, name: str) -> None:
        """Make the edit of a form."""
        form = FORMS[name]
        files = [self.methods / f"m_{name}.py", *(self.library / file.replace("NAME", name) for file in form.files)]
        if form.new:
            (self.library / form.new.replace("NAME", name)).write_text("")
        elif form.data:
            form.data(self.library / name, AFTER)
        elif not name.startswith("environment"):
            file = next(file for file in reversed(files) if str(BEFORE) in file.read_text())
            file.write_text(file.read_text().replace(str(BEFORE), str(AFTER)))

    @property
    def environment(self) -> dict[str, str]:
        folders = {"beside": [], "project": [], "installed": [self.root / "package", self.library]}[self.layout]
        return {"PYTHONPATH": os.pathsep.join(map(str, folders))}


def study(place: Place, names: list[str]) -> None:
    """A study of forms, with one of either number beside them."""
    for name, value in (("before", BEFORE), ("after", AFTER)):
        (place.config.parent / f"{name}_.py").write_text(number(f"return {value}") + SCALED)
    methods = [f"{{name: '{place.method(name)}', label: {name}}}" for name in names]
    methods += [f"{{name: '{name}_.py:solve', label: {name}}}" for name in ("before", "after")]
    place.config.write_text(
        "title: edits\ndisplay: {profiles: [ideal], panel: [128, 128]}\n"
        "targets: {dataset: photographs, params: {count: 1}}\nprotocol: {metrics: [psnr]}\n"
        f"methods: [{', '.join(methods)}]\n"
    )


def run(place: Place, output: str, value: float) -> tuple[dict[str, str], str]:
    """The score of each form by its label, as the study's ``records.csv`` has them, and what was printed."""
    environment = {**os.environ, **place.environment, "HOLO_TEST_NUMBER": str(value), "COLUMNS": "400"}
    command = [str(Path(sys.executable).with_name("holoeval")), "run", place.config.name, "--output", output]
    done = subprocess.run(
        command, cwd=place.config.parent, env=environment, capture_output=True, text=True, check=False
    )
    with (place.config.parent / output / "records.csv").open() as file:
        rows = list(csv.DictReader(file))
    return {row["label"]: row.get("psnr_linear_db", "") for row in rows}, done.stdout + done.stderr


def verdicts(place: Place, names: list[str]) -> Iterator[str]:
    """A line for each form that is wrong."""
    place.write(names)
    study(place, names)
    first, _ = run(place, "holoeval-results/a", BEFORE)
    _, again = run(place, "holoeval-results/a", BEFORE)
    print(f"{place.layout}: again: {again.splitlines()[0]}", flush=True)
    for name in names:
        place.edit(name)
    edited, words = run(place, "holoeval-results/a", AFTER)
    print(f"{place.layout}: edited: {words.splitlines()[0]}", flush=True)
    other, _ = run(place, "holoeval-results/b", AFTER)
    (covered,) = re.findall(r"^Not covered: .*$", words, flags=re.MULTILINE) or [""]
    print(f"{place.layout}: {covered}", flush=True)
    for name in names:
        is_told = re.search(rf"[ ;]{name} reads", covered) is not None
        right = {first["before"]: "old", first["after"]: "new"}
        got = [right.get(row[name], row[name]) for row in (first, edited, other)]
        covered_now, told_now = ["old", "new", "new"], ["old", "old", "new"]
        may_tell = FORMS[name].told or place.layout == "installed"  # whose import may have read what it does not name
        if not ((got == covered_now and not FORMS[name].told) or (got == told_now and is_told and may_tell)):
            yield f"{place.layout}: {name}: {got}{' told' * is_told}"


if __name__ == "__main__":
    root = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp())
    wrong = [line for layout in LAYOUTS for line in verdicts(Place(root / layout, layout), list(FORMS))]
    print("\n".join(wrong), f"{len(FORMS) * len(LAYOUTS)} edits, {len(wrong)} wrong", sep="\n")
