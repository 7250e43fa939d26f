"""Colours of verdicts, and Table 1 in them."""

from __future__ import annotations

import pandas as pd
from markupsafe import Markup

from ankleloop_lab.pages.rendering import render_table
from ankleloop_workflow.paper.ledger import VERDICTS, tabulate_table1

# Backgrounds that are told apart in print and by readers who do not see red or green; the words stand in them.
COLOURS = ("#b7dfc2", "#dff0c8", "#eef0c0", "#f3b8a6", "#e3e3e3", "#f6dd9b", "#cfe0f5")
VERDICT_COLOURS = dict(zip(VERDICTS, COLOURS, strict=True))


def render_table1(ledger: pd.DataFrame) -> Markup:
    """Table 1 as HTML, each cell in the colour of its verdict."""
    cells, verdicts = tabulate_table1(ledger)
    colours = {text: VERDICT_COLOURS[verdict] for text, verdict in verdicts.items()}
    return render_table(cells, colours=colours)
