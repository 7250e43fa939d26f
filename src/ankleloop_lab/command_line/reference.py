"""The reference of the command line, `docs/reference/command-line.md`: what `--help` prints of each verb.

``python -m ankleloop_lab.command_line.reference`` writes it.
"""

from __future__ import annotations

from pathlib import Path

import click

from ankleloop_lab.command_line.main import commands

REFERENCE = Path(__file__).parents[3] / "docs" / "reference" / "command-line.md"
VERBS = ("check", "identify", "plan", "live", "study", "demo")
HEAD = """---
html_theme.sidebar_secondary.remove: true
---

# Command line

The texts of `ankleloop --help` and of each verb.
"""


def reference_text() -> str:
    """The page: the help of the command and of its verbs."""
    whole = click.Context(
        commands, info_name="ankleloop", terminal_width=110, **commands.context_settings
    )
    parts = [HEAD, _block(whole)]
    for verb in VERBS:
        context = click.Context(commands.commands[verb], whole, verb, terminal_width=110)
        parts.append(f"## {verb}\n\n{_block(context)}")
    return "\n".join(parts)


def _block(context: click.Context) -> str:
    """The help of a command as text."""
    lines = [line.rstrip() for line in context.get_help().splitlines()]
    text = "\n".join(lines)
    return f"```text\n{text}\n```\n"


if __name__ == "__main__":
    REFERENCE.write_text(reference_text(), encoding="utf-8")
