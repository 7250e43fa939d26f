"""Flowcharts in the mermaid language as pictures, drawn while the site is built: nothing is loaded from a network.

The part of the language that Snakemake writes is known: `flowchart TB`, and lines `a & b --> c`.
"""

import html
import re
from itertools import pairwise

from docutils import nodes
from sphinx.util.docutils import SphinxDirective

WIDTH, HEIGHT, GAP, STEP = 9, 30, 24, 66  # of a letter, a box, the space beside it, and a row [px]
EDGE = re.compile(r"^\s*(\w+(?: & \w+)*) --> (\w+)\s*$")
STYLE = 'fill="none" stroke="currentColor"'


def parse_flowchart(text):
    """Edges of a flowchart, as pairs of names.

    Raises
    ------
    ValueError
        For a line that is no edge.
    """
    head, *lines = text.strip().splitlines()
    if head.strip() != "flowchart TB":
        raise ValueError(f"a flowchart begins with 'flowchart TB', not with {head!r}.")
    edges = []
    for line in lines:
        match = EDGE.match(line)
        if match is None:
            raise ValueError(f"not an edge of a flowchart: {line!r}.")
        edges += [(source, match[2]) for source in match[1].split(" & ")]
    return edges


def arrange(edges):
    """Rows of names, and the path of each edge through the rows: a point without a box is an edge in passing.

    The row of a name is its longest distance from a beginning. Within a row names follow the mean place of what leads
    to them and of what they lead to.
    """
    names = list(dict.fromkeys(name for edge in edges for name in edge))
    depth = dict.fromkeys(names, 0)
    for _ in names:
        for source, target in edges:
            depth[target] = max(depth[target], depth[source] + 1)
    for name in names:  # a beginning stands just above what needs it
        targets = [depth[target] for source, target in edges if source == name]
        if targets and all(target != name for _, target in edges):
            depth[name] = min(targets) - 1
    paths = [
        [source, *((source, target, row) for row in range(depth[source] + 1, depth[target])), target]
        for source, target in edges
    ]
    rows = [[name for name in names if depth[name] == row] for row in range(max(depth.values()) + 1)]
    for path in paths:
        for point in path[1:-1]:
            rows[point[2]].append(point)
    links = [pair for path in paths for pair in pairwise(path)]
    for _ in range(12):
        for row, above in [*zip(rows[1:], rows, strict=False), *zip(rows[-2::-1], rows[::-1], strict=False)]:
            place = {point: k - len(above) / 2 for k, point in enumerate(above)}
            means = {point: _mean_place(point, links, place, k - len(row) / 2) for k, point in enumerate(row)}
            row.sort(key=means.get)
    return rows, paths


def _mean_place(point, links, place, default):
    neighbours = [place[b] for a, b in links if a == point and b in place]
    neighbours += [place[a] for a, b in links if b == point and a in place]
    return sum(neighbours) / len(neighbours) if neighbours else default


def draw_flowchart(edges):
    """The flowchart as SVG in the colours of the text around it."""
    rows, paths = arrange(edges)
    widths = {point: WIDTH * len(point) + 20 if isinstance(point, str) else 12 for row in rows for point in row}
    lengths = [sum(widths[point] + GAP for point in row) - GAP for row in rows]
    width, height = max(lengths) + 20, STEP * (len(rows) - 1) + HEIGHT + 20
    centres = {}
    for number, (row, length) in enumerate(zip(rows, lengths, strict=True)):
        x = (width - length) / 2
        for point in row:
            centres[point] = (x + widths[point] / 2, 10 + STEP * number + HEIGHT / 2)
            x += widths[point] + GAP
    parts = [
        '<defs><marker id="arrow" viewBox="0 0 8 8" refX="8" refY="4" markerWidth="8" markerHeight="8" orient="auto">'
        '<path d="M0,0 L8,4 L0,8 z" fill="currentColor"/></marker></defs>'
    ]
    for path in paths:
        parts.append(f'<path d="{_curve([centres[point] for point in path])}" {STYLE} marker-end="url(#arrow)"/>')
    for name in centres:
        if isinstance(name, str):
            x, y = centres[name]
            parts.append(
                f'<rect x="{x - widths[name] / 2:.0f}" y="{y - HEIGHT / 2:.0f}" width="{widths[name]}" '
                f'height="{HEIGHT}" rx="4" {STYLE}/>'
                f'<text x="{x:.0f}" y="{y + 5:.0f}" text-anchor="middle" fill="currentColor">{html.escape(name)}</text>'
            )
    size = f'viewBox="0 0 {width:.0f} {height:.0f}" style="max-width: {width:.0f}px"'
    return f'<svg class="flowchart" role="img" {size} xmlns="http://www.w3.org/2000/svg">{"".join(parts)}</svg>'


def _curve(points):
    """A curve through points, vertical in each; it begins below the first box and ends above the last one."""
    (x, y), *following = points
    y += HEIGHT / 2
    text = f"M{x:.0f},{y:.0f}"
    for k, (next_x, next_y) in enumerate(following):
        last = k == len(following) - 1
        end = next_y - HEIGHT / 2 if last else next_y
        middle = (y + end) / 2
        text += f" C{x:.0f},{middle:.0f} {next_x:.0f},{middle:.0f} {next_x:.0f},{end:.0f}"
        x, y = next_x, end
    return text


class Flowchart(SphinxDirective):
    """The directive `mermaid`: a picture of a flowchart."""

    has_content = True

    def run(self):
        """Draw the content."""
        try:
            picture = draw_flowchart(parse_flowchart("\n".join(self.content)))
        except ValueError as error:
            raise self.error(str(error)) from error
        return [nodes.raw("", picture, format="html")]


def setup(app):
    """Register the extension with Sphinx."""
    app.add_directive("mermaid", Flowchart)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
