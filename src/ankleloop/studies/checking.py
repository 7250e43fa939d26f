"""Checks of values against a model of the configuration, and errors that name the key."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin

from pydantic import ValidationError

from ankleloop.options import Options, describe_error

__all__ = ["ConfigError", "check", "check_unique_keys"]

MERGE = "tag:yaml.org,2002:merge"  # of the key <<, which may stand several times


class ConfigError(ValueError):
    """A configuration with an unknown key or an impossible value: the message names the key."""


def check(model: type[Options], values: Mapping[str, Any], *place: str) -> Any:
    """Check values and fill in the defaults.

    Parameters
    ----------
    model : type of Options
        What the values are of.
    values : mapping
        Values by key.
    *place : str
        Keys under which the values stand, for error messages.

    Returns
    -------
    Options

    Raises
    ------
    ConfigError
        For an unknown or missing key, or a value out of its range; the message names the key.

    Examples
    --------
    >>> from ankleloop.studies.config import FigureSettings
    >>> check(FigureSettings, {"length": -1}, "config", "figure")
    Traceback (most recent call last):
      ...
    ankleloop.studies.checking.ConfigError: config → figure → length [s]: must be above 0, got -1.
    """
    try:
        return model.model_validate(values)
    except ValidationError as error:
        raise ConfigError(_describe(error, model, place)) from None


def check_unique_keys(path: str | os.PathLike[str]) -> None:
    r"""Refuse a YAML file with a key that stands twice: a reader of YAML takes the last one and says nothing.

    Parameters
    ----------
    path : path-like
        The file.

    Raises
    ------
    ConfigError
        The message names the key and both lines.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder, "config.yaml")
    ...     _ = path.write_text("run: [table1]\nrun: [table2]\n")
    ...     check_unique_keys(path)
    Traceback (most recent call last):
      ...
    ankleloop.studies.checking.ConfigError: ...config.yaml: the key 'run' in line 2 stands in line 1, too.
    """
    import yaml

    with open(path, encoding="utf-8") as file:
        pending, seen = [yaml.compose(file)], set()
    while pending:
        node = pending.pop()
        if node is None or id(node) in seen:  # an alias is the node of its anchor
            continue
        seen.add(id(node))
        if isinstance(node, yaml.SequenceNode):
            pending += node.value
        elif isinstance(node, yaml.MappingNode):
            lines: dict[str, int] = {}
            for key, value in node.value:
                line = key.start_mark.line + 1
                if key.value in lines and key.tag != MERGE:
                    raise ConfigError(
                        f"{path}: the key {key.value!r} in line {line} stands in line {lines[key.value]}, too."
                    )
                lines[str(key.value)] = line
                pending.append(value)


def _describe(error: ValidationError, model: type[Options], place: Sequence[str]) -> str:
    """Sentence about the first fault; a misspelt key comes before a missing one."""
    first = min(error.errors(), key=lambda fault: fault["type"] != "extra_forbidden")
    keys, owner = _locate(model, first["loc"])
    key = keys[-1] if keys else ""
    field = owner.model_fields.get(key) if owner else None
    unit = f" [{owner.unit(key)}]" if owner and field and _is_number(field.annotation) else ""
    parents, name = " → ".join([*place, *keys[:-1]]), " → ".join([*place, *keys])
    if first["type"] == "extra_forbidden":
        return f"{parents}: unknown key {key!r}; known here: {', '.join(_keys(owner))}."
    if first["type"] == "missing":
        return f"{parents}: the key {key!r} is missing."
    if first["type"].startswith("union_tag"):
        expected, tag = first["ctx"]["discriminator"].strip("'"), first["ctx"].get("tag")
        if tag is None:
            return f"{name}: the key {expected!r} is missing."
        return f"{name} → {expected}: must be one of {first['ctx']['expected_tags']}; got {tag!r}."
    if first["type"] in ("dict_type", "model_type", "model_attributes_type"):
        return f"{name}: must be a mapping of keys to values, got {first['input']!r}."
    return f"{name}{unit}: {describe_error(first).rstrip('.')}."


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
