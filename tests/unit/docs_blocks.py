"""Blocks of code of the documentation, with the output that stands behind them."""

import re
import textwrap
from dataclasses import dataclass, replace
from pathlib import Path

ROOT = Path(__file__).parents[2]
FENCE = re.compile(
    r"^(?P<indent> *)(?P<marks>`{3,})(?P<language>[^\n`]*)\n(?P<code>.*?)^(?P=indent)(?P=marks) *$",
    re.MULTILINE | re.DOTALL,
)
OUTSIDE = ("README.md", "CONTRIBUTING.md", "SECURITY.md", "config/README.md", "data/README.md")


@dataclass(frozen=True)
class Block:
    """A block of code: where it stands, its language, and the output behind it, if there is one."""

    page: str
    line: int
    language: str
    code: str
    tags: str = ""
    output: str | None = None

    @property
    def place(self):
        """Page and line, as a terminal shows them."""
        return f"{self.page}:{self.line}"


def documentation_pages():
    """All pages with text of ours, relative to the repository."""
    return [*OUTSIDE, *(path.relative_to(ROOT).as_posix() for path in sorted((ROOT / "docs").rglob("*.md")))]


def read_blocks(page):
    """The blocks of a page; a block `text` that follows another one is its output."""
    text = (ROOT / page).read_text(encoding="utf-8")
    blocks, end = [], 0
    for match in FENCE.finditer(text):
        language, code = match["language"].strip(), textwrap.dedent(match["code"])
        if language == "text" and blocks and not text[end : match.start()].strip() and blocks[-1].output is None:
            blocks[-1] = replace(blocks[-1], output=code)
        else:
            tags = re.match(r":tags: \[(.*)\]\n", code)
            code = code[tags.end() :] if tags else code
            language = "python" if language == "{code-cell} python" else language
            blocks.append(Block(page, text.count("\n", 0, match.start()) + 1, language, code, tags[1] if tags else ""))
        end = match.end()
    return blocks


def top_level_parts(code):
    """A block of YAML, cut before each line that begins a key at the top level.

    Blocks that show alternatives have a key several times, which no YAML file may have.
    """
    parts = re.split(r"^(?=[\w-]+:)", code, flags=re.MULTILINE)
    return [part for part in parts if re.match(r"[\w-]+:", part)]
