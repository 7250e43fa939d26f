"""Values that a user writes, in a configuration, a table or a command: an error names the key, or the line."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any, get_args, get_origin

from pydantic import ValidationError

from ankleloop.options import Options, describe_error, suggest_name
from ankleloop.trials.files import PathLike

Values = dict[str, Any]  # by name

KINDS = {int: "count", bool: "flag", float: "number"}


class ConfigError(ValueError):
    """A configuration with an unknown key or an impossible value.

    Parameters
    ----------
    message : str
        Sentence that names the key.
    keys : sequence of str
        Keys that lead to it, from the top level of the configuration; none where it is no part of that.
    """

    def __init__(self, message: str, keys: Sequence[str] = ()) -> None:
        super().__init__(message)
        self.keys = tuple(keys)


def check(model: type[Options], values: Any, *place: str) -> Any:
    """Check values and fill in the defaults."""
    try:
        return model.model_validate(values)
    except ValidationError as error:
        # A misspelt key comes before a missing one.
        fault = min(error.errors(), key=lambda fault: fault["type"] != "extra_forbidden")
    keys, owner = _locate(model, fault["loc"])
    kind = fault["type"]
    context = fault.get("ctx", {})
    name = "".join(keys[-1:])
    shown = keys
    if kind.startswith("union_tag"):
        keys.append(context["discriminator"].strip("'"))
    if kind == "extra_forbidden":
        shown = keys[:-1]
        known = [field.alias or key for key, field in owner.model_fields.items()]
        sentence = (
            f"unknown key {name!r}{suggest_name(name, known)}; known here: {', '.join(known)}"
        )
    elif kind in ("missing", "union_tag_not_found"):
        sentence = f"the key {keys.pop()!r} is missing"
    elif kind == "union_tag_invalid":
        sentence = f"must be one of {context['expected_tags']}; got {context['tag']!r}"
    elif kind == "string_pattern_mismatch":
        signs = "_ - ." if "." in context["pattern"] else "_ -"
        sentence = (
            f"must consist of letters A-Z a-z, digits and {signs}, and begin with a letter or digit"
        )
    else:
        sentence = describe_error(fault, owner.unit(name), owner.limits(name))
        first, _, rest = sentence.partition(": ")
        # A check of several keys names its own.
        if not keys and first in model.model_fields:
            keys.append(first)
            sentence = rest
        sentence += _find_remedy(kind, fault["input"])
    text = " → ".join([*place, *shown])
    raise ConfigError(f"{text}: {sentence.rstrip('.')}.", (*place[1:], *keys))


def _find_remedy(kind: str, value: Any) -> str:
    """What to do about quotes, where YAML reads text as a number or a number as text."""
    if kind == "string_type" and value is not None and not isinstance(value, (list, Mapping)):
        return ": put it in quotes"
    is_number = isinstance(value, str) and not isinstance(cast_number(value), str)
    if kind in ("int_type", "float_type") and is_number:
        return ", which is text: write it without quotes, and powers of ten as 1.0e+3; --config takes no numbers"
    return ""


def _locate(model: type[Options], location: Iterable[int | str]) -> tuple[list[str], type[Options]]:
    """Keys that lead to a fault, as the configuration has them, and the model to which the last key belongs."""
    annotation: Any = model
    keys: list[str] = []
    owner = model
    for part in location:
        annotation = get_args(annotation)[0] if get_origin(annotation) is Annotated else annotation
        member = next((member for member in get_args(annotation) if part in _tags(member)), None)
        if member or part == "[key]":  # which pydantic adds to the keys
            annotation = member or annotation
            continue
        keys.append(str(part))
        owner = annotation if hasattr(annotation, "model_fields") else Options
        field = owner.model_fields.get(str(part))
        annotation = field.annotation if field else (get_args(annotation) or (None,))[-1]
    return keys, owner


def _tags(member: Any) -> list[Any]:
    """Values of the key that tells members of a union apart: the kind of a study, the name of a method."""
    fields = getattr(member, "model_fields", {})
    return [
        tag
        for key in ("kind", "method")
        if key in fields
        for tag in get_args(fields[key].annotation)
    ]


def find_kind(annotation: Any) -> str:
    """Kind of the values of a field: count, flag, number or text."""
    kinds = get_args(annotation) or (annotation,)
    types = {
        kind if isinstance(kind, type) else getattr(kind, "__origin__", type(kind))
        for kind in kinds
    }
    return next((word for kind, word in KINDS.items() if kind in types), "text")


def cast_number(text: str) -> Any:
    """The number that a text is; any other text as it is."""
    for kind in (int, float):
        with suppress(ValueError):
            return kind(text)
    return text


def read_text(path: PathLike) -> str:
    """Text of a file in UTF-8, with or without byte order mark."""
    try:
        return Path(path).read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise ConfigError(
            f"{path}: this is not UTF-8 ({error.reason}); save the file as UTF-8."
        ) from None
    except OSError as error:
        raise ConfigError(
            f"{path}: the file cannot be read ({error.strerror}); check the path."
        ) from None


def read_rows(path: PathLike) -> Iterator[tuple[str, dict[str, str]]]:
    """Place and cells of each row of a CSV table, as text without spaces around it; empty rows are left out."""
    reader = csv.DictReader(io.StringIO(read_text(path)), restkey="", strict=True)
    try:
        keys = [key.strip() for key in reader.fieldnames or ()]
        reader.fieldnames = keys
        names = list(filter(None, keys))
        if len(set(names)) < len(names) or re.search("[;\t]", "".join(names)):
            raise ConfigError(
                f"{path}, line 1: columns have names of their own, with commas between them (no semicolons, "
                f"no tabulators); got {', '.join(keys)}."
            )
        for row in reader:
            place = f"{path}, line {reader.line_num}"
            has_spare = any(row.pop("", ""))
            has_values = any(row.values())
            if has_spare or (None in row.values() and has_values):
                raise ConfigError(
                    f"{place}: the row does not fit the {len(keys)} columns: put texts with commas in quotes, and "
                    "write the commas of empty cells, too. Is the table cut off?"
                )
            if has_values:
                yield place, {key: text.strip() for key, text in row.items()}
    except csv.Error as error:
        raise ConfigError(f"{path}, line {reader.line_num}: this is not CSV: {error}.") from None
