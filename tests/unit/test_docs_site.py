"""The documentation builds as a site without a warning, has every public name, and needs no network to be read.

Pages that compute are not executed here: test_docs_code.py runs their code, tests/nightly/test_docs_site.py builds all.
"""

import re
import subprocess
import sys
from html.parser import HTMLParser
from urllib.parse import unquote, urlsplit

import pytest
from docs_blocks import ROOT, documentation_pages

import ankleloop

pytest.importorskip("sphinx", reason="the site is built by the packages of the extra docs")

LOADED = {"script": "src", "img": "src", "iframe": "src", "source": "src", "link": "href"}
NAME = re.compile(r"\bankleloop(?:\.\w+)+")


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The site, built strictly."""
    folder = tmp_path_factory.mktemp("site")
    # The kernel, which does not run here, would say in what language the cells are.
    settings = ("-D", "nb_execution_mode=off", "-D", "suppress_warnings=myst-nb.lexer")
    options = ("-W", "-n", "--keep-going", "-q", "-b", "html", *settings, "-d", folder / "trees")
    process = subprocess.run(
        [sys.executable, "-m", "sphinx", *options, ROOT / "docs", folder / "html"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert process.returncode == 0, process.stderr
    return folder / "html"


class Links(HTMLParser):
    """What a page loads, what it links to, and the names that links may end at."""

    def __init__(self, text):
        super().__init__()
        self.loaded, self.links, self.anchors = [], [], set()
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        attributes = dict(attributes)
        self.anchors |= {attributes.get("id"), attributes.get("name")} - {None}
        if tag in LOADED and attributes.get("rel") not in ("canonical", "search", "index", "next", "prev"):
            self.loaded.append(attributes.get(LOADED[tag]))
        elif tag == "a":
            self.links.append(attributes.get("href"))


@pytest.fixture(scope="module")
def pages(site):
    """Links of every page, by its path."""
    paths = [path for path in site.rglob("*.html") if "_static" not in path.parts]  # templates of the theme
    return {path: Links(path.read_text(encoding="utf-8")) for path in paths}


def test_every_page_of_the_documentation_is_in_the_site(site):
    for page in documentation_pages():
        if page.startswith("docs/"):
            assert (site / page.removeprefix("docs/")).with_suffix(".html").is_file(), page


def test_nothing_is_loaded_from_a_network(pages):
    outside = [
        (path.name, target)
        for path, page in pages.items()
        for target in page.loaded
        if target and urlsplit(target).netloc
    ]
    assert outside == []
    assert not any("mathjax" in path.name.lower() for path in pages)


def test_every_link_within_the_site_has_its_file_and_its_place(site, pages):
    broken = []
    for path, page in pages.items():
        for target in filter(None, [*page.links, *page.loaded]):
            parts = urlsplit(target)
            if parts.scheme or parts.netloc:
                continue
            file = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            file = file / "index.html" if file.is_dir() else file
            places = pages[file].anchors if file in pages else set()
            if not file.is_file() or (parts.fragment and file in pages and unquote(parts.fragment) not in places):
                broken.append((path.name, target))
    assert broken == []


def test_every_public_name_has_a_page_with_an_example(site):
    reference = (site / "reference" / "api.html").read_text(encoding="utf-8")
    for name in set(ankleloop.__all__) - {"subspace"}:
        assert f'id="ankleloop.{name}"' in reference or f"generated/ankleloop.{name}.html" in reference, name
    for path in (site / "reference" / "generated").glob("*.html"):
        text = path.read_text(encoding="utf-8")
        assert "Examples" in text, path.name
        assert "&gt;&gt;&gt; " in text, path.name
    assert {f"ankleloop.subspace.{name}.html" for name in ankleloop.subspace.__all__} <= {
        path.name for path in (site / "reference" / "generated").iterdir()
    }


def test_names_of_the_library_in_the_text_exist():
    from sphinx.ext.autosummary import import_by_name

    for page in documentation_pages():
        for name in set(NAME.findall((ROOT / page).read_text(encoding="utf-8"))) - {"ankleloop.methods.stiffness"}:
            assert import_by_name(name)[1] is not None, f"{page}: {name}"
