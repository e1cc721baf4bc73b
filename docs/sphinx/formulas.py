"""Formulas as MathML, which a browser draws by itself: a page loads no program for them, and nothing from elsewhere.

In Markdown a formula is ``$...$`` in a line and ``$$...$$`` on lines of its own, as code hosts read it.
"""

from __future__ import annotations

from docutils import nodes
from latex2mathml.converter import convert
from sphinx.application import Sphinx
from sphinx.util import logging
from sphinx.writers.html5 import HTML5Translator

LOG = logging.getLogger(__name__)


def mathml(node: nodes.math | nodes.math_block, display: str) -> str:
    """A formula, with a warning for what the converter does not know: it would stand in the page as LaTeX.

    display: "inline" or "block".
    """
    drawn = convert(node.astext(), display=display)
    if "\\" in drawn:
        LOG.warning("no MathML for the formula %s", node.astext(), location=node)
    return drawn


def inline(translator: HTML5Translator, node: nodes.math) -> None:
    """A formula in a line."""
    translator.body.append(mathml(node, "inline"))
    raise nodes.SkipNode


def block(translator: HTML5Translator, node: nodes.math_block) -> None:
    """A formula on lines of its own."""
    translator.body.append(f'<div class="formula">{mathml(node, "block")}</div>\n')
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the writer of formulas, which ``html_math_renderer`` names."""
    app.add_html_math_renderer("mathml", (inline, None), (block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
