"""Files of the configuration: what readers of YAML change or leave out without a word is refused, with its line.

``python -m ankleloop.studies.config_files FILE`` checks files; snakemake itself reads those of ``--configfile`` first.
"""

from __future__ import annotations

import codecs
import json
import os
import re
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ankleloop.studies.checking import ConfigError

if TYPE_CHECKING:
    import yaml

MAX_VALUES = 1_000_000  # of a file, those that aliases repeat included
MAX_DEPTH = 100
TEMPLATE_KEY = "__use_yte__"  # makes a YAML file a program of the template engine that Snakemake reads it by
YAML_TAG = "tag:yaml.org,2002:"
MERGE = f"{YAML_TAG}merge"  # of the key <<, which may stand several times
KINDS = frozenset(f"{YAML_TAG}{kind}" for kind in ("str", "int", "float", "bool", "null", "seq", "map", "merge"))
KINDS_OF_KEYS = {
    f"{YAML_TAG}{tag}": kind
    for tag, kind in {
        "int": "a number",
        "float": "a number",
        "bool": "true or false",
        "null": "nothing",
        "timestamp": "a date",
    }.items()
}
# Numbers as everybody reads them; YAML 1.1 also has 012 (octal, 10), 1_2 (12), 1:30 (90) and 0x1F (31).
DECIMAL = re.compile(r"[-+]?(0|[1-9][0-9]*)|[-+]?([0-9]+\.[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?|[-+]?\.(inf|nan)", re.I)


def check_config_file(path: str | os.PathLike[str]) -> None:
    r"""Refuse a file in which YAML would lose or change something: a key that stands twice, the subject 012."""
    text = read_text(path)
    if _is_json(path, text):
        return
    root = _compose(path, text)
    if type(root).__name__ != "MappingNode":
        raise ConfigError(f"{path}: must have keys at the top level, such as 'studies:'.")
    for node in _nodes(root):
        if node.tag not in KINDS:
            _refuse_tag(path, node)
        if isinstance(node.value, str):
            _check_number(path, node)
            continue
        _check_merges(path, node)
        if node.id == "mapping":
            _check_keys(path, node)
    _count_values(path, root, {})


def read_text(path: str | os.PathLike[str]) -> str:
    """Text of a file in UTF-8, with or without byte order mark."""
    try:
        content = Path(path).read_bytes()
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise ConfigError(f"{path}: the file cannot be read ({reason}); check the path.") from None
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)) or b"\0" in content[:100]:
        raise ConfigError(f"{path} is text in UTF-16 or no text at all: save it as UTF-8.")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise ConfigError(f"{path}, line {line}: this is not UTF-8 ({error.reason}); save the file as UTF-8.") from None


def find_key(keys: Sequence[str], paths: Sequence[str | os.PathLike[str]]) -> str:
    """File and line of a key of the configuration, for error messages."""
    best, place = 0, ""
    for path in paths:
        try:
            node = _compose(path, read_text(path))
        except ConfigError:
            continue
        for depth, key in enumerate(keys, start=1):
            pair = next((pair for pair in _pairs(node) if pair[0].value == key), None)
            if pair is None:
                break
            node = pair[1]
            if depth >= best:
                best, place = depth, f"{path}, line {pair[0].start_mark.line + 1}"
    return place


def _pairs(node: Any) -> Iterator[tuple[yaml.Node, yaml.Node]]:
    """Keys and values of a mapping, those that it takes over by << at the end."""
    if getattr(node, "id", None) != "mapping":
        return
    merged: list[yaml.Node] = []
    for key, value in node.value:
        if key.tag == MERGE:
            merged += value.value if value.id == "sequence" else [value]
        else:
            yield key, value
    for other in merged:
        yield from _pairs(other)


def _is_json(path: str | os.PathLike[str], text: str) -> bool:
    """Check a file of JSON; False if it is none."""
    keys_of: list[list[str]] = []

    def collect(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        keys_of.append([key for key, _ in pairs])
        return dict(pairs)

    try:
        content = json.loads(text, object_pairs_hook=collect)
    except (ValueError, RecursionError):
        return False
    for keys in keys_of:
        for key, count in Counter(keys).items():
            if count > 1:
                raise ConfigError(f"{path}: the key {key!r} stands twice in one mapping.")
    if not isinstance(content, dict):
        raise ConfigError(f"{path}: must have keys at the top level.")
    return True


def _compose(path: str | os.PathLike[str], text: str) -> Any:
    """Tree of a YAML file."""
    import yaml

    loader, depth = getattr(yaml, "CSafeLoader", yaml.SafeLoader), 0
    try:
        for event in yaml.parse(text, Loader=loader):  # without recursion, unlike compose
            depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
            if depth > MAX_DEPTH:
                line = event.start_mark.line + 1
                raise ConfigError(f"{path}, line {line}: lists and mappings are nested more than {MAX_DEPTH} deep.")
        return yaml.compose(text, Loader=loader)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line = f", line {mark.line + 1}" if mark else ""
        raise ConfigError(f"{path}{line}: this is not YAML: {error.problem or error.context}.") from None
    except yaml.YAMLError as error:
        raise ConfigError(f"{path}: this is not YAML: {' '.join(str(error).split())}.") from None


def _nodes(root: yaml.Node) -> Iterator[Any]:
    """All nodes, each once: an alias is the node of its anchor."""
    pending, seen = [root], set()
    while pending:
        node = pending.pop()
        if id(node) in seen:
            continue
        seen.add(id(node))
        yield node
        if node.id == "sequence":
            pending += reversed(node.value)
        elif node.id == "mapping":
            pending += [part for pair in reversed(node.value) for part in reversed(pair)]


def _refuse_tag(path: str | os.PathLike[str], node: Any) -> None:
    place = f"{path}, line {node.start_mark.line + 1}"
    if node.tag == f"{YAML_TAG}timestamp":
        raise ConfigError(f"{place}: YAML reads {node.value} as a date: put it in quotes.")
    raise ConfigError(f"{place}: the tag {node.tag.removeprefix(YAML_TAG)!r} has no meaning here: leave it out.")


def _check_number(path: str | os.PathLike[str], node: Any) -> None:
    """Refuse a number that YAML reads otherwise than most people."""
    if node.tag in (f"{YAML_TAG}int", f"{YAML_TAG}float") and not DECIMAL.fullmatch(node.value):
        import yaml

        number = yaml.safe_load(node.value)
        raise ConfigError(
            f"{path}, line {node.start_mark.line + 1}: YAML reads {node.value} as {number}: write {number}, or put "
            f"'{node.value}' in quotes if it is text."
        )


def _check_keys(path: str | os.PathLike[str], mapping: Any) -> None:
    """Refuse keys that stand twice, and keys that are no text."""
    import yaml

    lines: dict[str, int] = {}
    for key, _ in mapping.value:
        line = key.start_mark.line + 1
        if key.tag == MERGE:
            continue
        if not isinstance(key, yaml.ScalarNode):
            raise ConfigError(f"{path}, line {line}: a key must be text, not a list or a mapping.")
        if key.tag != f"{YAML_TAG}str":
            kind = KINDS_OF_KEYS.get(key.tag, "something else")
            raise ConfigError(f"{path}, line {line}: YAML reads the key {key.value} as {kind}: put it in quotes.")
        if key.value == TEMPLATE_KEY:
            raise ConfigError(
                f"{path}, line {line}: with the key {key.value} Snakemake runs Python code of this file when it reads "
                "it, before anything can check it: leave it out. If the file is from somebody else, look what it ran."
            )
        if key.value in lines:
            raise ConfigError(f"{path}: the key {key.value!r} in line {line} stands in line {lines[key.value]}, too.")
        lines[key.value] = line


def _check_merges(path: str | os.PathLike[str], node: Any) -> None:
    """Refuse << that is no key, or whose value is no mapping and no list of mappings."""
    values = node.value if node.id == "sequence" else [value for _, value in node.value]
    wrong = [value for value in values if value.tag == MERGE]
    for key, value in node.value if node.id == "mapping" else ():
        if key.tag == MERGE:
            wrong += [part for part in (value.value if value.id == "sequence" else [value]) if part.id != "mapping"]
    if wrong:
        raise ConfigError(
            f"{path}, line {wrong[0].start_mark.line + 1}: << takes over the keys of another mapping: write <<: *NAME, "
            "where &NAME stands at that mapping; put << in quotes if it is text."
        )


def _count_values(path: str | os.PathLike[str], node: Any, counts: dict[int, int]) -> int:
    """Values under a node, with those that aliases repeat; refuse too many, and an alias within its own anchor."""
    if isinstance(node.value, str):
        return 1
    if id(node) not in counts:
        counts[id(node)] = -1  # being counted
        parts = node.value if node.id == "sequence" else [value for _, value in node.value]
        counts[id(node)] = 1 + sum(_count_values(path, part, counts) for part in parts)
    count = counts[id(node)]
    line = node.start_mark.line + 1
    if count < 0:
        raise ConfigError(f"{path}, line {line}: an alias stands within the anchor that it repeats.")
    if count > MAX_VALUES:
        raise ConfigError(f"{path}, line {line}: more than {MAX_VALUES:,} values, counting those that aliases repeat.")
    return count


if __name__ == "__main__":
    for argument in sys.argv[1:]:
        try:
            check_config_file(argument)
        except ConfigError as error:
            sys.exit(str(error))
