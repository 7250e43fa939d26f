"""Templates and tables: every value that enters is escaped."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

# Names of methods in cells, which are as short as they can be; one before a word begins a sentence.
SHORT_NAMES = {
    r"Refined instrumental variables(?! \w)( \(riv\))?": "riv",
    "Parallel cascade": "cascade",
}
LEAST_TEXT = 24  # letters of a cell from which on it is a text, which wraps
NUMBER = r"[+-]?[\d.,]+(e[+-]?\d+)?|nan"
ENVIRONMENT = Environment(
    loader=PackageLoader(__package__),
    autoescape=True,
    undefined=StrictUndefined,
    trim_blocks=True,
)
# Bokeh reads the models of a figure in their order.
ENVIRONMENT.policies["json.dumps_kwargs"] = {"sort_keys": False}


def render_template(name: str, /, environment: Environment = ENVIRONMENT, **values: Any) -> Markup:
    """Fill in a template, of this package or of an environment of another one."""
    return Markup(environment.get_template(name).render(**values))  # noqa: S704 # what enters has been escaped


def render_table(
    table: pd.DataFrame,
    links: Sequence[str] = (),
    *,
    colours: Mapping[str, str] | None = None,
    name: str = "",
) -> Markup:
    """Table as HTML with a link for each row; columns with one value are said below it.

    Cells with a colour have it as background. A long table with a name has a field that filters its rows.
    """
    cells = table.map(str).replace(SHORT_NAMES, regex=True)
    constant = {}
    for column in cells.columns[1:]:
        if len(cells) > 2 and cells[column].nunique() == 1:
            constant[column] = cells.pop(column).iloc[0]
    return render_template(
        "table.html.j2",
        table=cells,
        name=name,
        classes=[_class_of(cells[column]) for column in cells],
        constant=constant,
        links=links,
        colours=colours or {},
    )


def _class_of(column: pd.Series) -> str:
    """Class of the cells of a column: numbers, texts that wrap, or neither."""
    texts = column[~column.isin(["", "–"])]
    if len(texts) and texts.str.fullmatch(NUMBER).all():
        return "number"
    return "text" if texts.str.len().max() > LEAST_TEXT else ""


ENVIRONMENT.globals["render_table"] = render_table
