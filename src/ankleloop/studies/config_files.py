"""Files of the configuration: what readers of YAML change or leave out without a word is refused, with its line.

``python -m ankleloop.studies.config_files FILE`` checks files; snakemake itself reads those of ``--configfile`` first.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml

from ankleloop.studies.checking import ConfigError

PathLike = str | os.PathLike[str]

LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
MAX_VALUES = 1_000_000  # of a file, those that aliases repeat included
MAX_DEPTH = 100
TEMPLATE_KEY = "__use_yte__"  # makes a YAML file a program of the template engine that Snakemake reads it by
YAML_TAG = "tag:yaml.org,2002:"
MERGE = f"{YAML_TAG}merge"  # of the key <<
WRONG_MERGE = (
    "<< takes over the keys of another mapping: write <<: *NAME, where &NAME stands at that mapping; put << in quotes "
    "if it is text."
)
KINDS = ("str", "int", "float", "bool", "null", "seq", "map")
KINDS_OF_KEYS = {"bool": "true or false", "null": "nothing", "timestamp": "a date", "int": "a number"}
KINDS_OF_KEYS["float"] = KINDS_OF_KEYS["int"]
# Numbers as everybody reads them; YAML 1.1 also has 012 (octal, 10), 1_2 (12), 1:30 (90) and 0x1F (31).
DECIMAL = re.compile(r"[-+]?(0|[1-9][0-9]*)|[-+]?([0-9]+\.[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?|[-+]?\.(inf|nan)", re.I)


def check_config_file(path: PathLike) -> None:
    r"""Refuse a file in which YAML would lose or change something: a key that stands twice, the subject 012."""
    root = _compose(path)
    if root is None or root.id != "mapping":
        raise ConfigError(f"{path}: must have keys at the top level, such as 'studies:'.")
    _check_node(path, root, {})


def read_text(path: PathLike) -> str:
    """Text of a file in UTF-8, with or without byte order mark."""
    try:
        return Path(path).read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = error.object.count(b"\n", 0, error.start) + 1
        raise ConfigError(f"{path}, line {line}: this is not UTF-8 ({error.reason}); save the file as UTF-8.") from None
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise ConfigError(f"{path}: the file cannot be read ({reason}); check the path.") from None


def find_key(keys: Sequence[str], paths: Sequence[PathLike]) -> str:
    """File and line of a key of the configuration, for error messages."""
    best, place = 0, ""
    for path in paths:
        try:
            node = _compose(path)
        except ConfigError:
            continue
        for depth, key in enumerate(keys, start=1):
            if not isinstance(node, yaml.MappingNode):
                break
            yaml.SafeLoader("").flatten_mapping(node)  # what it takes over by << stands before its own keys
            pair = next((pair for pair in reversed(node.value) if pair[0].value == key), None)
            if pair is None:
                break
            node = pair[1]
            if depth >= best:
                best, place = depth, f"{path}, line {pair[0].start_mark.line + 1}"
    return place


def _compose(path: PathLike) -> Any:
    """Tree of a YAML file."""
    text, depth = read_text(path), 0
    try:
        for event in yaml.parse(text, Loader=LOADER):  # without recursion, unlike compose
            depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
            if depth > MAX_DEPTH:
                line = event.start_mark.line + 1
                raise ConfigError(f"{path}, line {line}: lists and mappings are nested more than {MAX_DEPTH} deep.")
        return yaml.compose(text, Loader=LOADER)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line = f", line {mark.line + 1}" if mark else ""
        raise ConfigError(f"{path}{line}: this is not YAML: {error.problem or error.context}.") from None
    except yaml.YAMLError as error:
        raise ConfigError(f"{path}: this is not YAML: {' '.join(str(error).split())}.") from None


def _check_node(path: PathLike, node: Any, counts: dict[int, int]) -> int:
    """Check a node and all below it, each once; the number of values, those that aliases repeat included."""

    def refuse(message: str) -> ConfigError:
        return ConfigError(f"{path}, line {node.start_mark.line + 1}: {message}")

    kind = node.tag.removeprefix(YAML_TAG)
    if kind == "timestamp":
        raise refuse(f"YAML reads {node.value} as a date: put it in quotes.")
    if kind not in KINDS:
        raise refuse(WRONG_MERGE if kind == "merge" else f"the tag {kind!r} has no meaning here: leave it out.")
    if isinstance(node, yaml.ScalarNode):
        if kind in ("int", "float") and not DECIMAL.fullmatch(node.value):
            number, quoted = yaml.safe_load(node.value), f"put '{node.value}' in quotes if it is text."
            raise refuse(f"YAML reads {node.value} as {number}: write {number}, or {quoted}")
        return 1
    if id(node) not in counts:
        counts[id(node)] = -1  # being counted
        if isinstance(node, yaml.MappingNode):
            _check_keys(path, node)
        parts = [value for _, value in node.value] if isinstance(node, yaml.MappingNode) else node.value
        counts[id(node)] = 1 + sum(_check_node(path, part, counts) for part in parts)
    if counts[id(node)] < 0:
        raise refuse("an alias stands within the anchor that it repeats.")
    if counts[id(node)] > MAX_VALUES:
        raise refuse(f"more than {MAX_VALUES:,} values, counting those that aliases repeat.")
    return counts[id(node)]


def _check_keys(path: PathLike, mapping: yaml.MappingNode) -> None:
    """Refuse keys that stand twice, keys that are no text, and << without another mapping."""
    lines: dict[str, int] = {}
    for key, value in mapping.value:
        line = key.start_mark.line + 1
        others = value.value if value.id == "sequence" else [value]
        kind = KINDS_OF_KEYS.get(key.tag.removeprefix(YAML_TAG), "something else")
        if not isinstance(key.value, str):
            raise ConfigError(f"{path}, line {line}: a key must be text, not a list or a mapping.")
        if key.tag == MERGE and any(other.id != "mapping" for other in others):
            raise ConfigError(f"{path}, line {value.start_mark.line + 1}: {WRONG_MERGE}")
        if key.tag not in (MERGE, f"{YAML_TAG}str"):
            raise ConfigError(f"{path}, line {line}: YAML reads the key {key.value} as {kind}: put it in quotes.")
        if key.value == TEMPLATE_KEY:
            raise ConfigError(
                f"{path}, line {line}: with the key {key.value} Snakemake runs Python code of this file when it reads "
                "it, before anything can check it: leave it out. If the file is from somebody else, look what it ran."
            )
        if key.value in lines:
            raise ConfigError(f"{path}: the key {key.value!r} in line {line} stands in line {lines[key.value]}, too.")
        lines[key.value] = line


if __name__ == "__main__":
    for argument in sys.argv[1:]:
        try:
            check_config_file(argument)
        except ConfigError as error:
            sys.exit(str(error))
