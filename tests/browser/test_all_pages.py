"""Every page of the results in a browser, as wide as a desktop and as narrow as a phone."""

import json
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

from ankleloop_lab.pages.page import render_page

pytestmark = pytest.mark.workflow

LAYOUT = Path(__file__).with_name("layout.js").read_text(encoding="utf-8")
LINKS = "() => [...document.querySelectorAll('a[href]')].map((link) => link.href)"
ANCHORS = "() => [...document.querySelectorAll('[id]')].map((element) => element.id)"
CONTENTS = """() => ({
  headings: document.querySelectorAll("h2, h3").length,
  contents: document.querySelectorAll("nav .contents a").length,
  back: document.querySelector("nav a.back")?.href,
})"""

# Tables that are wider than their boxes, whether the boxes scroll, and whether the first column stays.
TABLES = """() => [...document.querySelectorAll("table")].map((table) => {
  const box = table.closest(".scroll");
  const cut = !box || box.scrollWidth > box.clientWidth + 1;
  if (!cut) return "whole";
  const cell = table.querySelector("tbody td");
  const scrolls = box && getComputedStyle(box).overflowX === "auto" && getComputedStyle(cell).position === "sticky";
  return scrolls ? "scrolls" : "cut off";
})"""


@pytest.fixture(scope="module")
def pages(reproduction):
    results = reproduction / "results"
    paths = sorted(results.glob("*.html")) + sorted((results / "reports").rglob("*.html"))
    names = {path.relative_to(results).as_posix() for path in paths}
    assert {
        "index.html",
        "article.html",
        "ledger.html",
        "reports/table1.html",
    } <= names
    return {path.relative_to(results).as_posix(): path for path in paths}


@pytest.fixture(scope="module", params=["desktop", "phone"])
def views(request, pages, new_visit):
    """What there is to see on each page, as wide as a desktop or a phone."""
    views = {}
    for name, path in pages.items():
        with new_visit(request.param) as visited:
            page = visited.open(path).page
            view = {"layout": page.evaluate(LAYOUT), **page.evaluate(CONTENTS)}
            view |= {"width": request.param, "tables": page.evaluate(TABLES)}
            view |= {"links": page.evaluate(LINKS), "anchors": set(page.evaluate(ANCHORS))}
            views[name] = {**view, "errors": visited.errors, "requests": visited.requests}
    return views


def test_every_page_is_whole(views):
    """No error, no picture that is missing, no text over text, no heading without text, nothing wider than the page."""
    faults = {}
    for name, view in views.items():
        layout = dict(view["layout"])
        assert layout.pop("texts") > 5, name
        faults[name] = view["errors"] + [(kind, value) for kind, value in layout.items() if value]
    assert {name: texts for name, texts in faults.items() if texts} == {}


def test_no_table_is_cut_off(views):
    """All columns at the width of a desktop; a phone scrolls a table in its box, in which the first column stays."""
    allowed = {"desktop": {"whole"}, "phone": {"whole", "scrolls"}}
    faults = {
        name: view["tables"]
        for name, view in views.items()
        if set(view["tables"]) - allowed[view["width"]]
    }
    assert faults == {}
    assert sum(len(view["tables"]) for view in views.values()) > 20


def test_no_page_fetches_anything(views, pages):
    """Only the index shows files beside it: its figures."""
    for name, view in views.items():
        files = [url for url in view["requests"] if not url.startswith("data:")]
        assert files[0] == pages[name].as_uri()
        pictures = pages["index.html"].with_name("figures").as_uri()
        assert all(name == "index.html" and url.startswith(pictures) for url in files[1:]), name


def test_every_link_leads_somewhere(views, pages):
    anchors = {pages[name].resolve(): view["anchors"] for name, view in views.items()}
    broken = []
    for name, view in views.items():
        for url in view["links"]:
            parts = urlsplit(url)
            target = Path(unquote(parts.path)).resolve()
            # Browsers look for the name of an anchor as it stands, and then for what it means.
            names = {parts.fragment, unquote(parts.fragment)} - {""}
            if (
                parts.scheme != "file"
                or not target.exists()
                or (names and not names & anchors[target])
            ):
                broken.append((name, url))
    assert broken == []


def test_every_page_links_back_and_has_its_contents(views, pages):
    index = pages["index.html"].as_uri()
    for name, view in views.items():
        assert view["contents"] == view["headings"] > 0, name
        assert view["back"] == (None if name == "index.html" else index), name


def test_the_index_leads_to_everything(pages, reproduction, visit):
    page = visit(pages["index.html"]).page
    targets = {Path(unquote(urlsplit(url).path)).resolve() for url in page.evaluate(LINKS)}
    results = reproduction / "results"
    studies = json.loads((results / "configuration.json").read_text(encoding="utf-8"))["run"]
    assert len(pages) == 3 + len(studies) + 3  # of recordings
    assert {path.resolve() for path in pages.values()} <= targets
    groups = ["figure1.*", "figure2.*", *(f"{study}-*" for study in studies)]
    figures = {path for group in groups for path in (results / "figures").glob(group)}
    assert {path.resolve() for path in figures} <= targets
    assert page.locator(".figures figcaption").count() == len({path.stem for path in figures})
    text = page.inner_text("main")
    for phrase in ("ankleloop ", "Python", "Made"):
        assert phrase in text


def test_tables_are_sorted_by_a_click(pages, visit):
    page = visit(pages["index.html"]).page
    read = "rows => rows.map((row) => parseFloat(row.cells[3].textContent))"
    table = page.locator("table", has_text="trials per point")
    heading = table.locator("th", has_text="points")
    rows = table.locator("tbody tr")
    heading.click()
    numbers = rows.evaluate_all(read)
    assert numbers == sorted(numbers)
    heading.press("Enter")
    assert rows.evaluate_all(read) == sorted(numbers, reverse=True)


def test_the_ledger_has_its_colours_and_is_filtered(pages, visit):
    page = visit(pages["ledger.html"]).page
    rows = page.locator("tbody tr")
    colours = rows.locator(".verdict").evaluate_all(
        "items => items.map((item) => [item.textContent, item.style.background])"
    )
    assert len(colours) == rows.count()
    assert len({colour for _, colour in colours}) == len({verdict for verdict, _ in colours}) > 2
    page.fill("input.filter", "table1 reflex")
    visible = [row for row in rows.all() if row.is_visible()]
    assert 0 < len(visible) < rows.count()
    assert all("table1" in row.inner_text() for row in visible)


def test_pages_print_without_what_is_for_the_screen(pages, visit):
    page = visit(pages["reports/table1.html"]).page
    assert page.locator("figure.interactive").is_visible()
    page.emulate_media(media="print")
    assert not page.locator("figure.interactive").is_visible()
    assert not page.locator("nav").is_visible()
    assert page.locator("img").first.is_visible()
    assert page.pdf().startswith(b"%PDF")


def test_a_script_in_a_text_does_not_run(visit, tmp_path):
    """A caption is Markdown, in which HTML stays HTML; the policy of the page stops it, and nothing is fetched."""
    hostile = (
        "<script>document.title = 'taken'</script><img src=x onerror=\"document.title = 'taken'\">"
    )
    fetched = '<img src="http://127.0.0.1:9/x.png"><iframe src="http://127.0.0.1:9/"></iframe>'
    table = '<table class="sortable"><thead><tr><th>a</th></tr></thead><tbody><tr><td>1</td></tr></tbody></table>'
    path = tmp_path / "page.html"
    path.write_text(render_page("Results", hostile + fetched + table), encoding="utf-8")
    visited = visit(path)
    assert visited.page.title() == "Results · ankleloop"
    assert any("Content Security Policy" in text for text in visited.errors)
    assert (
        visited.page.locator("th").get_attribute("tabindex") == "0"
    )  # the library's own script runs
