"""Measured numbers in the documentation: blocks of a page that a function writes, and that know their source.

A page holds a block between two comments. The first has the date and the commit of the run that wrote it, and a
fingerprint of its source: of the code of all library modules that the block depends on, of the configuration of its
studies, and of the function itself. Where the source has changed since, the numbers are out of date.
"""

import ast
import hashlib
import inspect
import io
import json
import re
import textwrap
import tokenize
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import yaml

from ankleloop.studies.fingerprint import LIBRARY, reached_files

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", ROOT / "config" / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
MARKED = re.compile(
    r"<!-- numbers: (?P<name>[\w-]+)(?: \((?P<stamp>[^)]*)\))? -->\n(?P<text>.*?)<!-- end of numbers -->", re.DOTALL
)


class Unavailable(Exception):
    """A block cannot be written on this machine."""


@dataclass(frozen=True)
class Block:
    """A block of a page.

    `sources` are modules of the library or files of the project; what they import belongs to them, unless `imports` is
    False: counts of tests do not change with the library that is tested. `studies` are studies of config/config.yaml
    whose settings the numbers depend on.
    """

    name: str
    write: Callable[[], str]
    sources: tuple[str, ...]
    studies: tuple[str, ...] = ()
    imports: bool = True

    @property
    def fingerprint(self):
        """12 hexadecimal digits that change with the source of the numbers."""
        digest = hashlib.sha256(_code(inspect.getsource(self.write)).encode())
        files = set(map(_source_file, self.sources))
        for path in sorted(files | reached_files(*files) if self.imports else files):
            digest.update(f"{path.relative_to(ROOT)} {_code_hash(path)}\n".encode())
        for study in self.studies:
            digest.update(json.dumps(_studies()[study], sort_keys=True).encode())
        return digest.hexdigest()[:12]


BLOCKS = {}


def block(name, sources, studies=(), *, imports=True):
    """Register a function without arguments that returns the Markdown of a block."""

    def register(write):
        if name in BLOCKS:
            raise ValueError(f"there are two blocks {name}.")
        BLOCKS[name] = Block(name, write, tuple(sources), tuple(studies), imports)
        return write

    return register


def read_stamps():
    """For each block that stands in a page the page, and its stamp (None before the first run)."""
    stamps = {}
    for page in PAGES:
        for match in MARKED.finditer(page.read_text(encoding="utf-8")):
            if match["name"] in stamps:
                raise ValueError(f"the block {match['name']} stands in two places.")
            stamps[match["name"]] = (page, match["stamp"])
    return stamps


def is_current(item, stamp):
    """Whether a block was written from the source as it is now."""
    return stamp is not None and stamp.endswith(f"source {item.fingerprint}")


def insert(page, name, text, stamp):
    """The page with the text of a block and its stamp between its markers."""

    def replace(match):
        if match["name"] != name:
            return match[0]
        lines = [_wrap(line) for line in text.strip().splitlines()]
        return "\n".join([f"<!-- numbers: {name} ({stamp}) -->", *lines, "<!-- end of numbers -->"])

    return MARKED.sub(replace, page)


def _wrap(line):
    """A line of text at the width of the pages; tables and pictures as they are."""
    if line.startswith(("|", "!")):
        return line
    indent = "  " if line.startswith("- ") else ""
    return textwrap.fill(line, 120, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)


def _source_file(source):
    """File of a module of the library, or a file of the project."""
    if source.startswith("ankleloop."):
        module = LIBRARY.joinpath(*source.split("."))
        return module / "__init__.py" if module.is_dir() else module.with_suffix(".py")
    return ROOT / source


@cache
def _studies():
    return yaml.safe_load((ROOT / "config" / "config.yaml").read_text(encoding="utf-8"))["studies"]


@cache
def _code_hash(path):
    text = path.read_text(encoding="utf-8")
    return hashlib.sha256((_code(text) if path.suffix == ".py" else text).encode()).hexdigest()


def _code(text):
    """Python code without docstrings, comments and white space: what these say changes no number."""
    lines = text.splitlines(keepends=True)
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.COMMENT:
            row, column = token.start
            lines[row - 1] = lines[row - 1][:column] + "\n"
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef)) and ast.get_docstring(node) is not None:
            for row in range(node.body[0].lineno, node.body[0].end_lineno + 1):
                lines[row - 1] = ""
    return re.sub(r"\s+", "", "".join(lines))
