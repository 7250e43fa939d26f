"""Tables that the site reads from the library: options, settings, quantities; and names in its docstrings."""

import json
import re
from typing import ClassVar

from docutils import nodes
from docutils.parsers.rst.directives import flag
from pydantic_core import to_jsonable_python
from sphinx.addnodes import pending_xref
from sphinx.ext.autosummary import import_by_name
from sphinx.util.docutils import SphinxDirective, SphinxRole

from ankleloop.options import Options, type_name
from ankleloop.quantities import QUANTITIES

PACKAGES = ("ankleloop", "ankleloop_lab", "ankleloop_workflow")


def options_rows(options, *, yaml=False):
    """Name, meaning, default, unit, bounds and type of each option, as Python or as YAML writes them."""
    rows = []
    for name, field in options.model_fields.items():
        default = "required" if field.is_required() else _default(field, yaml=yaml)
        meaning = field.description or ""
        meaning = meaning if yaml else re.sub(r"\bnull\b", "None", meaning)
        unit = "" if options.unit(name) == "1" else options.unit(name)
        bounds = _bounds(options.limits(name))
        rows.append(
            (
                field.alias or name if yaml else name,
                meaning,
                default,
                unit,
                bounds,
                type_name(field.annotation),
            )
        )
    return rows


def _default(field, *, yaml):
    value = field.get_default(call_default_factory=True)
    if isinstance(value, Options):  # of keys that have a table of their own
        return "{}"
    return json.dumps(to_jsonable_python(value), ensure_ascii=False) if yaml else repr(value)


def _bounds(limits):
    signs = {"ge": "≥", "gt": ">", "le": "≤", "lt": "<"}
    return ", ".join(f"{signs[name]} {value:g}" for name, value in limits.items() if name in signs)


def quantity_rows():
    """Key, name, symbol and unit of each quantity."""
    return [
        (key, item.name, item.symbol, "" if item.unit == "1" else item.unit)
        for key, item in QUANTITIES.items()
    ]


class OptionsTable(SphinxDirective):
    """The directive `options-table`: the fields of a class of options; with `:yaml:` as the configuration has them."""

    required_arguments = 1
    option_spec: ClassVar = {"yaml": flag}

    def run(self):
        """Make the table."""
        _, options, *_ = import_by_name(self.arguments[0])
        if not (isinstance(options, type) and issubclass(options, Options)):
            raise self.error(f"{self.arguments[0]} is no class of options.")
        head = ("name", "meaning", "default", "unit", "bounds", "type")
        table = _table(head, options_rows(options, yaml="yaml" in self.options), code=(0, 2, 5))
        table["classes"].append("options-table")
        return [table]


class QuantitiesTable(SphinxDirective):
    """The directive `quantities-table`: symbols and units."""

    def run(self):
        """Make the table."""
        return [_table(("key", "name", "symbol", "unit"), quantity_rows(), code=(0,))]


def _table(head, rows, code):
    table = nodes.table(classes=["table"])
    group = nodes.tgroup(cols=len(head))
    group += [nodes.colspec(colwidth=1) for _ in head]
    group += nodes.thead("", _row(head, ()))
    group += nodes.tbody("", *(_row(row, code) for row in rows))
    table += group
    return table


def _row(cells, code):
    row = nodes.row()
    for k, text in enumerate(cells):
        content = nodes.literal(text, text) if k in code and text else nodes.Text(text)
        row += nodes.entry("", nodes.paragraph("", "", content))
    return row


class Name(SphinxRole):
    """The default role: a link to the documentation of a name, or code where the site does not have it."""

    def run(self):
        """Make the reference; `resolve_name` resolves it."""
        node = pending_xref(
            self.rawtext,
            nodes.literal(self.text, self.text),
            refdomain="",
            reftype="library-name",
            reftarget=self.text,
            refdoc=self.env.docname,
        )
        return [node], []


def resolve_name(app, env, node, content):
    """Link a name of the packages that the site documents; others stay code."""
    if node.get("reftype") != "library-name":
        return None
    domain, target = env.domains["py"], node["reftarget"].removesuffix("()")
    full_names = [f"{package}.{target}" for package in PACKAGES]
    is_full = target.partition(".")[0] in PACKAGES
    for name in (target, *full_names, f"ankleloop.{target.rpartition('.')[2]}"):
        if name.partition(".")[0] in PACKAGES and name in domain.objects:
            if name != target and is_full and not _same_object(name, target):
                continue
            entry = domain.objects[name]
            return nodes.reference(
                "",
                "",
                content,
                internal=True,
                refuri=app.builder.get_relative_uri(node["refdoc"], entry.docname)
                + "#"
                + entry.node_id,
            )
    return content


def _same_object(first, second):
    """Whether two dotted names stand for one object."""
    try:
        return import_by_name(first)[1] is import_by_name(second)[1]
    except ImportError:
        return False


def setup(app):
    """Register the extension with Sphinx."""
    app.add_directive("options-table", OptionsTable)
    app.add_directive("quantities-table", QuantitiesTable)
    app.add_role("library-name", Name())
    app.connect("missing-reference", resolve_name)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
