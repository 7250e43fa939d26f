"""Equations as MathML, which browsers draw themselves: no script, no font and no picture has to be loaded."""

from docutils.nodes import SkipNode
from latex2mathml.converter import convert


def inline(writer, node):
    """Write an equation within a line; the theme would cut off what is above it of the class `math`."""
    writer.body.append(f'<span class="inline-equation">{convert(node.astext())}</span>')
    raise SkipNode


def block(writer, node):
    """Write an equation on a line of its own."""
    writer.body.append(f'<div class="equation">{convert(node.astext(), display="block")}</div>')
    raise SkipNode


def setup(app):
    """Register the extension with Sphinx."""
    app.add_html_math_renderer("mathml", (inline, None), (block, None))
    app.config.html_math_renderer = "mathml"
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
