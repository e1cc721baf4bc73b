"""The site of the documentation: ``sphinx-build -W --keep-going -c docs/sphinx . build/site``.

The source folder is the repository, so that a link to code, a config or a report is the same here and on a code host.
Nothing is loaded from elsewhere, neither when the site is built nor when it is read.
"""

import os
import re
import sys
import tempfile
from pathlib import Path

import torch
from sphinx.application import Sphinx

HERE, ROOT = Path(__file__).parent, Path(__file__).parents[2]
sys.path[:0] = [str(HERE), str(ROOT)]  # stages.py, formulas.py; tests.docs
os.environ["COLUMNS"] = "100"  # of the tables that examples print
SCRATCH = ROOT / "build" / "scratch"  # where examples write
os.environ["XDG_CACHE_HOME"] = str(SCRATCH)
SCRATCH.mkdir(parents=True, exist_ok=True)
tempfile.tempdir = str(SCRATCH)
torch.set_num_threads(1)  # small panels

project = "holobench_eval"
copyright = "The holobench authors, MIT licence"
extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_copybutton",
    "sphinx_gallery.gen_gallery",
    "stages",
    "formulas",
]
root_doc = "docs/start/index"
include_patterns = ["CONTRIBUTING.md", "docs/**", "reports/**/report.md", "reports/**/details.md"]
exclude_patterns = ["**/.*", "artifacts", "build", "methods", "datasets", "tests", "configs"]
exclude_patterns += ["docs/gallery"]  # its pages are docs/examples, which the build writes

myst_heading_anchors = 3
myst_enable_extensions = ["dollarmath"]
myst_update_mathjax = False
html_math_renderer = "mathml"
smartquotes_action = "D"  # dashes; quotes stay as they are

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
autodoc_preserve_defaults = True
python_maximum_signature_line_length = 110
napoleon_google_docstring = False
napoleon_use_rtype = False
add_module_names = False

sphinx_gallery_conf = {
    "examples_dirs": str(ROOT / "docs" / "gallery"),
    "gallery_dirs": str(ROOT / "docs" / "examples"),
    "filename_pattern": "/plot_",
    "within_subsection_order": "FileNameSortKey",
    "download_all_examples": False,
    "show_signature": False,
    "capture_repr": (),
    "notebook_extensions": {".py"},
    "write_computation_times": False,
    "run_stale_examples": True,  # an example may change with the package
    "abort_on_example_error": True,
}

html_theme = "furo"
html_title = "holobench_eval"
html_static_path = ["static"]
html_extra_path = ["extra"]  # index.html, which leads to the first page
html_css_files = ["site.css"]
html_copy_source = False
html_show_sphinx = False
html_theme_options = {"light_css_variables": {"color-brand-primary": "#0b3c6f", "color-brand-content": "#0b5394"}}
copybutton_exclude = ".linenos, .gp"


def setup(app: Sphinx) -> None:
    """Links to the code of an example lead to its page in the site; the page on displays has its tables there."""
    app.connect("source-read", _link_examples)
    app.connect("source-read", _tables_of_displays)


def _link_examples(_: Sphinx, __: str, source: list[str]) -> None:
    source[0] = re.sub(r"\((\.\./|docs/)gallery/(plot_\w+)\.py\)", r"(\1examples/\2.rst)", source[0])


def _tables_of_displays(_: Sphinx, page: str, source: list[str]) -> None:
    if page == "docs/displays":
        from tests.docs.display_page import MARK, tables

        source[0] = source[0].replace(MARK, tables())
