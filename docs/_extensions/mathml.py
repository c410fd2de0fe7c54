"""Formulas as MathML, which browsers draw by themselves: pages need no network and load no fonts."""

from docutils import nodes
from docutils.utils.math import MathError
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.util import logging

logger = logging.getLogger(__name__)


def converted(node, **options):
    """Return a formula as MathML; one that docutils cannot read is a warning that says where it is."""
    try:
        return tex2mathml(node.astext(), **options)
    except MathError as error:
        logger.warning("formula %r: %s", node.astext(), error, location=node)
        return ""


def inline(writer, node):
    """Write a formula in a line of text."""
    writer.body.append(converted(node))
    raise nodes.SkipNode


def displayed(writer, node):
    """Write a formula on lines of its own."""
    writer.body.append(f'<div class="math">{converted(node, as_block=True)}</div>')
    raise nodes.SkipNode


def setup(app):
    """Register the renderer with Sphinx as ``mathml``."""
    app.add_html_math_renderer("mathml", (inline, None), (displayed, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
