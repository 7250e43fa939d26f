"""Measured numbers in the documentation are current, and stand in blocks that a command writes."""

import importlib
import re
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "docs" / "numbers"


@pytest.fixture(scope="module")
def renew():
    sys.path.insert(0, str(FOLDER))
    try:
        module = importlib.import_module("renew")
        module.load_blocks()
        yield module
    finally:
        sys.path.remove(str(FOLDER))


@pytest.fixture
def blocks(renew):
    return sys.modules["blocks"]


def test_every_block_has_a_function_and_a_place(renew, blocks):
    assert set(blocks.read_stamps()) == set(blocks.BLOCKS)


def test_no_number_is_older_than_its_source(renew, blocks):
    stamps = blocks.read_stamps()
    outdated = [name for name, item in blocks.BLOCKS.items() if not blocks.is_current(item, stamps[name][1])]
    assert not outdated, "the source of these numbers has changed: run `make docs-numbers` and commit the pages"


def test_stamps_have_date_and_commit(blocks):
    form = r"\d{4}-\d\d-\d\d, commit [0-9a-f]{7,}, source [0-9a-f]{12}"
    stale = [name for name, (_, stamp) in blocks.read_stamps().items() if not re.fullmatch(form, stamp or "")]
    assert not stale, "these blocks were never written, or with changes that are not committed: run `make docs-numbers`"


def test_a_block_that_was_never_written_is_out_of_date(blocks, tmp_path, monkeypatch):
    page = tmp_path / "page.md"
    page.write_text("<!-- numbers: new -->\n<!-- end of numbers -->\n", encoding="utf-8")
    monkeypatch.setattr(blocks, "PAGES", [page])
    assert blocks.read_stamps() == {"new": (page, None)}
    assert not blocks.is_current(blocks.Block("new", test_stamps_have_date_and_commit, ()), None)


def test_the_fingerprint_follows_code_and_nothing_else(blocks, tmp_path, monkeypatch):
    source = tmp_path / "source.py"
    monkeypatch.setattr(blocks, "ROOT", tmp_path)

    def fingerprint(text):
        source.write_text(text, encoding="utf-8")
        blocks._code_hash.cache_clear()
        return blocks.Block("x", test_stamps_have_date_and_commit, ("source.py",), ()).fingerprint

    first = fingerprint("def f(x):\n    return 2 * x\n")
    assert fingerprint('"""A text."""\n\n\ndef f(x):  # why\n    """Twice."""\n    return 2 * x\n') == first
    assert fingerprint("def f(x):\n    return 3 * x\n") != first


def test_the_fingerprint_follows_the_settings_of_the_study(blocks, monkeypatch):
    studies = {"s": {"trials": 1}}
    monkeypatch.setattr(blocks, "_studies", lambda: studies)
    item = blocks.Block("x", test_stamps_have_date_and_commit, (), ("s",))
    first = item.fingerprint
    studies["s"]["trials"] = 2
    assert item.fingerprint != first


def test_a_block_is_replaced_and_its_neighbours_stay(blocks):
    end = "<!-- end of numbers -->\n"
    page = f"a\n<!-- numbers: one -->\n{end}b\n<!-- numbers: two (old) -->\n3\n{end}"
    once = blocks.insert(page, "one", "1 \\d\n", "stamp")
    assert once == page.replace("<!-- numbers: one -->\n", "<!-- numbers: one (stamp) -->\n1 \\d\n")
    assert blocks.insert(once, "one", "1 \\d\n", "stamp") == once


# A measured number: a time, memory, a spread or a share of trials. Definitions (filters, rates, thresholds, settings of
# the paper) are not measured; a line that needs one of these units for a definition is listed with its text.
MEASURED = re.compile(r"±\s?\d|\d\s?(?:ms|µs|MiB|MB|GB|min|minutes?|seconds?|hours?|times)\b|\bmedian\b")
DEFINITIONS = ("poles 0.75 ± 0.37j", "(±40 ms)", "10 s and 1 s for each MB", "default: 1 minute", "passes ±1 rad")


def measured_lines(text, blocks):
    """Lines outside blocks and code that look as if they had a measured number."""
    text = blocks.MARKED.sub("", text)
    return [
        line for line in text.splitlines() if MEASURED.search(line) and not any(part in line for part in DEFINITIONS)
    ]


def test_no_measured_number_stands_outside_a_block(renew, blocks):
    lines = {
        page.relative_to(ROOT).as_posix(): measured_lines(page.read_text("utf-8"), blocks) for page in blocks.PAGES
    }
    assert {page: measured for page, measured in lines.items() if measured} == {}
