"""What the site adds to Sphinx: links that lead out of docs, flowcharts, tables of options, help of the command."""

import importlib
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ankleloop.options import Options, option

FOLDER = Path(__file__).parents[2] / "docs" / "extensions"
pytest.importorskip("sphinx", reason="the site is built by the packages of the extra docs")


def load(name):
    sys.path.insert(0, str(FOLDER))
    try:
        return importlib.import_module(name)
    finally:
        sys.path.remove(str(FOLDER))


flowchart, library_tables, outside_pages = map(load, ("flowchart", "library_tables", "outside_pages"))


@pytest.mark.parametrize(
    ("origin", "page", "text", "expected"),
    [
        ("config/README.md", "how-to/configuration", "[a](../docs/sweeps.md)", "[a](../sweeps.md)"),
        ("config/README.md", "how-to/configuration", "[a](#here)", "[a](#here)"),
        ("config/README.md", "how-to/configuration", "[a](../LICENSE)", "[a](../../LICENSE)"),
        ("docs/sweeps.md", "sweeps", "[a](../config/README.md#b), c", "[a](how-to/configuration.md#b), c"),
        ("docs/sweeps.md", "sweeps", "[a](https://b.c/d)", "[a](https://b.c/d)"),
        ("docs/sweeps.md", "sweeps", "[a]: ../config/README.md", "[a]: how-to/configuration.md"),
        ("docs/sweeps.md", "sweeps", "```\n[a](../config/README.md)\n```\n", "```\n[a](../config/README.md)\n```\n"),
    ],
)
def test_links_lead_to_the_same_file_from_the_page_that_shows_them(tmp_path, origin, page, text, expected):
    docs, pages = tmp_path / "docs", {"how-to/configuration": "config/README.md"}
    shown = outside_pages.rewrite_links(text, tmp_path / origin, docs / f"{page}.md", docs, pages)
    assert shown == expected


graphs = st.lists(st.tuples(st.integers(0, 8), st.integers(0, 8)), min_size=1, max_size=20).map(
    lambda pairs: sorted({(f"n{min(pair)}", f"n{max(pair)}") for pair in pairs if pair[0] != pair[1]} | {("n0", "n9")})
)


@given(graphs)
@settings(max_examples=50, deadline=None)
def test_in_a_flowchart_every_edge_leads_down_row_by_row(edges):
    rows, paths = flowchart.arrange(edges)
    row_of = {point: number for number, row in enumerate(rows) for point in row}
    assert {path[0] for path in paths} | {path[-1] for path in paths} == {name for edge in edges for name in edge}
    assert [(path[0], path[-1]) for path in paths] == edges
    for path in paths:
        assert [row_of[point] for point in path] == list(range(row_of[path[0]], row_of[path[-1]] + 1))


def test_a_flowchart_is_drawn_with_a_box_for_each_name():
    edges = flowchart.parse_flowchart("flowchart TB\n    a & b --> c\n    a --> b\n")
    assert edges == [("a", "c"), ("b", "c"), ("a", "b")]
    picture = ElementTree.fromstring(flowchart.draw_flowchart(edges))
    texts = [node.text for node in picture.iter() if node.tag.endswith("text")]
    assert sorted(texts) == ["a", "b", "c"]
    with pytest.raises(ValueError, match="not an edge"):
        flowchart.parse_flowchart("flowchart TB\n    a ==> c\n")


class Window(Options):
    """Options."""

    length: float | None = option(5.0, "length; null for all", unit="s", gt=0, le=60)
    kind: str = option(description="kind")


def test_tables_of_options_are_written_for_python_or_for_yaml():
    assert library_tables.options_rows(Window) == [
        ("length", "length; None for all", "5.0", "s", "> 0, ≤ 60", "float or None"),
        ("kind", "kind", "required", "", "", "str"),
    ]
    assert library_tables.options_rows(Window, yaml=True)[0][1] == "length; null for all"


def test_help_of_the_command_is_that_of_the_program():
    assert library_tables.command_help([]).startswith("Usage: ankleloop [OPTIONS] VERB")
    assert library_tables.command_help(["check"]).startswith("Usage: ankleloop check [OPTIONS] FILE")
    with pytest.raises(ValueError, match="no verb 'chek'"):
        library_tables.command_help(["chek"])
