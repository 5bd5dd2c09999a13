"""Equations as MathML, which browsers draw without a script or a network."""

from latex2mathml.converter import convert


def setup(app):
    """Replace the renderer of equations."""
    from docutils.nodes import SkipNode

    def shown(display):
        def visit(writer, node):
            drawn = convert(node.astext(), display=display)
            writer.body.append(drawn if display == "inline" else f'<div class="math">{drawn}</div>')
            raise SkipNode

        return visit

    app.add_html_math_renderer(
        "mathml", inline_renderers=(shown("inline"), None), block_renderers=(shown("block"), None)
    )
    return {"parallel_read_safe": True, "parallel_write_safe": True}
