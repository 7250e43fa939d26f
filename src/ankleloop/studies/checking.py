"""Checks of values against a model of the configuration, and errors that name the key."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin

from pydantic import ValidationError

from ankleloop.options import Options, describe_error, show_value, suggest_name

VARIABLE = re.compile(r"\$(?:\$|\{(\w+)\}|(\w+))")
# As people write it: Python also takes 1_0, nan and digits of other scripts.
NUMBER = re.compile(r"\s*[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?\s*")


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


def check(model: type[Options], values: Mapping[str, Any], *place: str) -> Any:
    """Check values and fill in the defaults."""
    try:
        return model.model_validate(values)
    except ValidationError as error:
        message, keys = _describe(error, model, place)
        raise ConfigError(message, (*place[1:], *keys)) from None


def expand_path(text: str, place: str) -> Path:
    """A path of the configuration, with environment variables and ~ replaced."""

    def read_variable(match: re.Match[str]) -> str:
        name = match[1] or match[2]
        if name is None:
            return "$"
        value = os.environ.get(name, "")
        if not value.strip():
            state = "empty" if name in os.environ else "not set"
            raise ConfigError(
                f"{place} is {text}, but the environment variable {name} is {state}. Set it to the folder, for "
                f"example: export {name}=/folder/of/your/recordings (a dollar sign in the name of a folder is $$)."
            )
        return value

    return Path(os.path.expanduser(VARIABLE.sub(read_variable, text)))


def _describe(error: ValidationError, model: type[Options], place: Sequence[str]) -> tuple[str, list[str]]:
    """Sentence about the first fault, and the keys that lead to it; a misspelt key comes before a missing one."""
    first = min(error.errors(), key=lambda fault: fault["type"] != "extra_forbidden")
    keys, owner = _locate(model, first["loc"])
    key = keys[-1] if keys else ""
    if first["type"] == "extra_forbidden":
        close = suggest_name(key, _keys(owner))
        sentence = f"unknown key {_cut(key)!r}{close}; known here: {', '.join(_keys(owner))}"
        return f"{_join(place, keys[:-1])}: {sentence}.", keys
    if first["type"] == "missing":
        return f"{_join(place, keys[:-1])}: the key {key!r} is missing.", keys[:-1]
    if first["type"].startswith("union_tag"):
        expected, tag = first["ctx"]["discriminator"].strip("'"), first["ctx"].get("tag")
        if tag is None:
            return f"{_join(place, keys)}: the key {expected!r} is missing.", keys
        keys = [*keys, expected]
        names = re.findall(r"'([^']*)'", first["ctx"]["expected_tags"])
        sentence = f"must be one of {first['ctx']['expected_tags']}{suggest_name(tag, names)}; got {show_value(tag)}"
        return f"{_join(place, keys)}: {sentence}.", keys
    field = owner.model_fields.get(key) if owner else None
    unit = f" [{owner.unit(key)}]" if owner and field and _is_number(field.annotation) else ""
    limits = owner.limits(key) if owner else {}
    return f"{_join(place, keys)}{unit}: {_describe_value(first, limits).rstrip('.')}.", keys


def _describe_value(fault: Mapping[str, Any], limits: Mapping[str, float]) -> str:
    """What is wrong with a value or a name, and what to write instead."""
    kind, value, context = fault["type"], fault["input"], fault.get("ctx", {})
    if kind in ("dict_type", "model_type", "model_attributes_type"):
        return f"must be a mapping of keys to values, got {show_value(value)}"
    if kind == "list_type":
        example = value if isinstance(value, str) and 0 < len(value) <= 40 else "a, b"
        return f"must be a list in brackets, such as [{example}]; got {show_value(value)}"
    if kind in ("too_short", "string_too_short"):
        return "must not be empty"
    if kind == "string_too_long":
        return f"must have at most {context['max_length']} characters, because it is part of paths; it has {len(value)}"
    if kind == "string_pattern_mismatch":
        signs = "_ - ." if "." in context["pattern"] else "_ -"
        signs = f"letters A-Z a-z, digits and {signs}"
        return f"must consist of {signs}, and begin with a letter or digit; got {_cut(value)!r}"
    remedy = ""
    if kind == "string_type" and value is not None and not isinstance(value, (list, Mapping)):
        remedy = ": put it in quotes"
    elif isinstance(value, str) and kind in ("int_type", "float_type") and NUMBER.fullmatch(value):
        remedy = (
            ", which is text: write it without quotes, powers of ten as 1.0e+3, and numbers of --config that stand in "
            "braces in a file for --configfile"
        )
    return describe_error(fault, limits=limits) + remedy


def _join(place: Sequence[str], keys: Sequence[str]) -> str:
    return " → ".join(_cut(part) for part in (*place, *keys))


def _cut(text: str) -> str:
    return text if len(text) <= 120 else f"{text[:110]}…"


def _locate(model: type[Options], location: Sequence[int | str]) -> tuple[list[str], type[Options] | None]:
    """Keys that lead to a fault, as the configuration has them, and the model to which the last key belongs.

    Locations of pydantic also hold the tag of each union, which is no key.
    """
    annotation: Any = model
    keys: list[str] = []
    owner: type[Options] | None = None
    for part in location:
        members = {tag: member for member in _members(annotation) for tag in _tags(member)}
        if part in members:
            annotation = members[part]
            continue
        if part == "[key]":
            continue
        keys.append(str(part))
        owner = annotation if isinstance(annotation, type) and issubclass(annotation, Options) else None
        if owner is not None:
            field = owner.model_fields.get(str(part))
            annotation = field.annotation if field else None
        else:
            annotation = (get_args(annotation) or (None,))[-1]
    return keys, owner


def _members(annotation: Any) -> tuple[Any, ...]:
    """Models of a tagged union; none of anything else."""
    if get_origin(annotation) is Annotated:
        annotation = get_args(annotation)[0]
    union = get_origin(annotation) in (Union, UnionType)
    return tuple(a for a in get_args(annotation) if isinstance(a, type) and issubclass(a, Options)) if union else ()


def _tags(model: type[Options]) -> tuple[Any, ...]:
    """Values of the key that tells the members of a union apart: the kind of a study, the name of a method."""
    return get_args(model.model_fields["kind" if "kind" in model.model_fields else "method"].annotation)


def _is_number(annotation: Any) -> bool:
    return bool({int, float} & {annotation, *get_args(annotation)})


def _keys(model: type[Options] | None) -> list[str]:
    return [field.alias or name for name, field in model.model_fields.items()] if model else []
