"""Files of the configuration: what YAML changes or leaves out without a word is refused; an error names the line.

Snakemake itself reads files of ``--configfile`` first; ``python -m ankleloop_workflow.config.files FILE`` checks them.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from string import Template
from typing import Any

import yaml

from ankleloop.trials.files import PathLike
from ankleloop_lab.checking import ConfigError, read_text

LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
# Makes a YAML file a program of the template engine that Snakemake reads it by.
TEMPLATE_KEY = "__use_yte__"
# 012 (octal, 10), 0x1F (31), 1_2 (12), 1:30 (90)
OTHER_NUMBER = re.compile(r"[-+]?0[0-9bx].*|.*[_:].*")


def key_error(place: Sequence[str], message: str) -> ConfigError:
    """Error of a key of the configuration."""
    return ConfigError(f"{' → '.join(('config', *place))}: {message}", place)


def check_cases(key: str, names: Iterable[str]) -> None:
    """Refuse names that are one to a file system that does not tell capitals from small letters."""
    first: dict[str, str] = {}
    for name in names:
        other = first.setdefault(name.lower(), name)
        if other != name:
            raise ConfigError(
                f"{key}: {other!r} and {name!r} differ in capitals only, which some file systems ignore."
            )


def expand_path(text: str, place: str) -> Path:
    """A path of the configuration, with environment variables and ~ replaced."""
    template = Template(text)
    for name in template.get_identifiers():
        if not os.environ.get(name):
            raise ConfigError(
                f"{place} is {text}, but the environment variable {name} is not set. Set it to the folder, for "
                f"example: export {name}=/folder/of/your/recordings (a dollar sign in the name of a folder is $$)."
            )
    return Path(os.path.expanduser(template.safe_substitute(os.environ)))


def check_config_file(path: PathLike) -> None:
    r"""Refuse a file in which YAML would lose or change something: a key that stands twice, the subject 012."""
    _parse(path, yaml.load)  # which refuses tags
    root = _parse(path, yaml.compose)
    if not isinstance(root, yaml.MappingNode):
        raise ConfigError(f"{path}: must have keys at the top level, such as 'studies:'.")
    nodes = [root]
    checked = set()
    while nodes:
        node = nodes.pop()
        if node in checked:  # which an alias repeats
            continue
        checked.add(node)
        kind = node.tag.rpartition(":")[2]
        if isinstance(node, yaml.MappingNode):
            _check_keys(path, [key for key, _ in node.value])
            nodes += [value for _, value in node.value]
        elif isinstance(node, yaml.SequenceNode):
            nodes += node.value
        elif kind in ("int", "float") and OTHER_NUMBER.fullmatch(node.value):
            number = yaml.safe_load(node.value)
            raise ConfigError(
                f"{path}, line {node.start_mark.line + 1}: YAML reads {node.value} as {number}: "
                f"write {number}, or put '{node.value}' in quotes if it is text."
            )


def _check_keys(path: PathLike, keys: Sequence[yaml.Node]) -> None:
    """Refuse keys that stand twice, keys that are no text, and the one with which a file is a program."""
    lines: dict[str, int] = {}
    for key in keys:
        name = key.value
        line = key.start_mark.line + 1
        kind = key.tag.rpartition(":")[2]
        if kind not in ("str", "merge"):
            raise ConfigError(
                f"{path}, line {line}: YAML reads the key {name} as {kind}: put it in quotes."
            )
        if name == TEMPLATE_KEY:
            raise ConfigError(
                f"{path}, line {line}: with the key {name} Snakemake runs Python code of this file when it reads it, "
                "before anything can check it: leave it out. If the file is from somebody else, look what it ran."
            )
        if name in lines:
            raise ConfigError(
                f"{path}: the key {name!r} in line {line} stands in line {lines[name]}, too."
            )
        lines[name] = line


def _parse(path: PathLike, parse: Callable[..., Any]) -> Any:
    """Values or nodes of a YAML file."""
    try:
        return parse(read_text(path), Loader=LOADER)
    except yaml.YAMLError as error:
        raise ConfigError(f"{path}: this is not YAML: {' '.join(str(error).split())}.") from None


def find_key(keys: Sequence[str], paths: Sequence[PathLike]) -> str:
    """File and line of a key of the configuration, for error messages."""
    deepest = 0
    place = ""
    for path in paths:
        node = _parse(path, yaml.compose)
        for depth, key in enumerate(keys, start=1):
            if not isinstance(node, yaml.MappingNode):
                break
            # What it takes over by << stands before its own keys then.
            yaml.SafeLoader("").flatten_mapping(node)
            pairs = {name.value: (name, value) for name, value in node.value}
            if key not in pairs:
                break
            name, node = pairs[key]
            if depth >= deepest:
                deepest = depth
                place = f"{path}, line {name.start_mark.line + 1}"
    return place


if __name__ == "__main__":
    for argument in sys.argv[1:]:
        try:
            check_config_file(argument)
        except ConfigError as error:
            sys.exit(str(error))
