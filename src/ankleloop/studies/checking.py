"""Checks of values against a model of the configuration, and errors that name the key."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from string import Template
from typing import Annotated, Any, get_args, get_origin

from pydantic import ValidationError

from ankleloop.options import Options, describe_error, show_value, suggest_name

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


def key_error(place: Sequence[str], message: str) -> ConfigError:
    """Error of a key of the configuration; an entry of `place` may have its unit in brackets."""
    return ConfigError(f"{' → '.join(('config', *place))}: {message}", [key.split(" [")[0] for key in place])


def check(model: type[Options], values: Mapping[str, Any], *place: str) -> Any:
    """Check values and fill in the defaults."""
    try:
        return model.model_validate(values)
    except ValidationError as error:
        # A misspelt key comes before a missing one.
        fault = min(error.errors(), key=lambda fault: fault["type"] != "extra_forbidden")
    keys, owner = _locate(model, fault["loc"])
    kind, name, context, shown = fault["type"], "".join(keys[-1:]), fault.get("ctx", {}), keys
    if kind == "extra_forbidden":
        known = [field.alias or key for key, field in owner.model_fields.items()] if owner else []
        sentence = f"unknown key {name!r}{suggest_name(name, known)}; known here: {', '.join(known)}"
        shown = keys[:-1]
    elif kind == "missing":
        sentence = f"the key {name!r} is missing"
        shown = keys = keys[:-1]
    elif kind == "union_tag_not_found":
        sentence = f"the key {context['discriminator']} is missing"
    elif kind == "union_tag_invalid":
        tag, tags = context["tag"], context["expected_tags"]
        close = suggest_name(tag, [text.strip("'") for text in tags.split(", ")])
        sentence = f"must be one of {tags}{close}; got {show_value(tag)}"
        shown = keys = [*keys, context["discriminator"].strip("'")]
    else:
        field = owner.model_fields.get(name) if owner else None
        if owner and field and {int, float} & {field.annotation, *get_args(field.annotation)}:
            shown = [*keys[:-1], f"{name} [{owner.unit(name)}]"]
        sentence = _describe_value(fault, owner.limits(name) if owner else {})
    text = " → ".join((*place, *shown))
    raise ConfigError(f"{text}: {sentence.rstrip('.')}.", (*place[1:], *keys))


def check_cases(key: str, names: Iterable[str]) -> None:
    """Refuse names that are one to a file system that does not tell capitals from small letters."""
    first: dict[str, str] = {}
    for name in names:
        other = first.setdefault(name.lower(), name)
        if other != name:
            raise ValueError(f"{key}: {other!r} and {name!r} differ in capitals only, which some file systems ignore")


def expand_path(text: str, place: str) -> Path:
    """A path of the configuration, with environment variables and ~ replaced."""
    template = Template(text)
    for name in template.get_identifiers():
        if not os.environ.get(name, "").strip():
            state = "empty" if name in os.environ else "not set"
            raise ConfigError(
                f"{place} is {text}, but the environment variable {name} is {state}. Set it to the folder, for "
                f"example: export {name}=/folder/of/your/recordings (a dollar sign in the name of a folder is $$)."
            )
    return Path(os.path.expanduser(template.safe_substitute(os.environ)))


def _describe_value(fault: Mapping[str, Any], limits: Mapping[str, float]) -> str:
    """What is wrong with a value or a name, and what to write instead."""
    kind, value, context = fault["type"], fault["input"], fault.get("ctx", {})
    if kind in ("dict_type", "model_type", "model_attributes_type"):
        return f"must be a mapping of keys to values, got {show_value(value)}"
    if kind == "list_type":
        example = value if isinstance(value, str) else "a, b"
        return f"must be a list in brackets, such as [{example}]; got {show_value(value)}"
    if kind in ("too_short", "string_too_short"):
        return "must not be empty"
    if kind == "string_too_long":
        return f"must have at most {context['max_length']} characters, because it is part of paths; it has {len(value)}"
    if kind == "string_pattern_mismatch":
        signs = "_ - ." if "." in context["pattern"] else "_ -"
        form = f"letters A-Z a-z, digits and {signs}, and begin with a letter or digit"
        return f"must consist of {form}; got {value!r}"
    remedy = ""
    if kind == "string_type" and value is not None and not isinstance(value, (list, Mapping)):
        remedy = ": put it in quotes"
    elif isinstance(value, str) and kind in ("int_type", "float_type") and NUMBER.fullmatch(value):
        remedy = (
            ", which is text: write it without quotes, powers of ten as 1.0e+3, and numbers of --config that stand in "
            "braces in a file for --configfile"
        )
    return describe_error(fault, limits=limits) + remedy


def _locate(model: type[Options], location: Sequence[int | str]) -> tuple[list[str], type[Options] | None]:
    """Keys that lead to a fault, as the configuration has them, and the model to which the last key belongs."""
    annotation: Any = model
    keys: list[str] = []
    owner: type[Options] | None = None
    for part in location:
        if get_origin(annotation) is Annotated:
            annotation = get_args(annotation)[0]
        member = next((member for member in get_args(annotation) if part in _tags(member)), None)
        if member or part == "[key]":  # which pydantic adds to the keys
            annotation = member or annotation
            continue
        keys.append(str(part))
        owner = annotation if isinstance(annotation, type) and issubclass(annotation, Options) else None
        field = owner.model_fields.get(str(part)) if owner else None
        annotation = field.annotation if owner and field else (get_args(annotation) or (None,))[-1]
    return keys, owner


def _tags(member: Any) -> list[Any]:
    """Values of the key that tells members of a union apart: the kind of a study, the name of a method."""
    fields = getattr(member, "model_fields", {})
    return [tag for key in ("kind", "method") if key in fields for tag in get_args(fields[key].annotation)]
