"""Fingerprints of the library code that a script or notebook uses.

Snakemake runs a job again when its script changes, not when a module that the script imports does. So each job carries
this fingerprint as a parameter: it covers the modules of the library that the script reaches, and no others.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

LIBRARY = Path(__file__).parents[2]
PACKAGE = "ankleloop"

# Regular expressions, because the syntax trees of a hundred modules would take longer than Snakemake's own start. They
# also find what looks like an import in a text: then a job runs once more than it has to, and none is missed.
IMPORT = re.compile(
    r"^[ \t]*(?:from[ \t]+(\.*[\w.]*)[ \t]+import[ \t]+(\([^)]*\)|[^\n;]*)|import[ \t]+([\w.][^\n;]*))", re.MULTILINE
)
STRING = re.compile(rf"""["']({PACKAGE}(?:\.\w+)+)["']""")
COMMENT = re.compile(r"#[^\n]*")


def fingerprint(*scripts: str | os.PathLike[str]) -> str:
    """Hash of all library files that scripts or notebooks reach, directly or through other modules.

    A module is reached by an import, at the top or within a function, or by its full name as a string, as
    `importlib.import_module` takes it. With a module go the data folders beside it, those without modules.
    """
    digest = hashlib.sha256()
    for path in sorted(reached_files(*scripts)):
        digest.update(f"{path.relative_to(LIBRARY)} {_content_hash(path, path.stat().st_mtime_ns)}\n".encode())
    return digest.hexdigest()[:16]


def reached_files(*scripts: str | os.PathLike[str]) -> set[Path]:
    """Library files that scripts, notebooks or modules reach, directly or through other modules."""
    modules: set[Path] = set()
    remaining = {file for script in scripts for file in _references(Path(script))}
    while remaining:
        path = remaining.pop()
        modules.add(path)
        remaining |= _references(path) - modules
    return modules | {file for folder in {path.parent for path in modules} for file in _data_files(folder)}


def _references(path: Path) -> frozenset[Path]:
    """Library files that a script, notebook or module refers to."""
    return _parse(path, path.stat().st_mtime_ns)


@cache
def _parse(path: Path, modified: int) -> frozenset[Path]:
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".ipynb":
        cells = [cell for cell in json.loads(text)["cells"] if cell["cell_type"] == "code"]
        text = "\n".join("".join(cell["source"]) for cell in cells)
    package = path.relative_to(LIBRARY).parent.parts if path.is_relative_to(LIBRARY) else ()
    return frozenset(file for name in _names(text, package) for file in _files(name))


@cache
def _content_hash(path: Path, modified: int) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _names(text: str, package: tuple[str, ...]) -> Iterator[str]:
    """Names that may be modules of the library, in the text of a module that belongs to a package."""
    yield from STRING.findall(text)
    for module, members, modules in IMPORT.findall(text):
        yield from _imported(modules)
        level = len(module) - len(module.lstrip("."))
        parents = package[: len(package) - level + 1] if level else ()
        source = ".".join([*parents, *filter(None, [module.lstrip(".")])])
        yield source
        yield from (f"{source}.{name}" for name in _imported(members))


def _imported(names: str) -> list[str]:
    """Names of an import statement, without their aliases and comments."""
    names = COMMENT.sub("", names).strip("() \t\n")
    return [name.split()[0] for name in names.split(",") if name.strip()]


def _files(name: str) -> Iterator[Path]:
    """File of a module, or the __init__ of a package; other names have none."""
    if name == PACKAGE:  # it imports its modules when their names are first used, which its source does not show
        yield from (LIBRARY / PACKAGE).rglob("*.py")
    elif name.startswith(f"{PACKAGE}.") and name.replace(".", "").isidentifier():
        path = LIBRARY.joinpath(*name.split("."))
        yield from (file for file in (path.with_suffix(".py"), path / "__init__.py") if file.is_file())


def _data_files(folder: Path) -> set[Path]:
    """Package data beside a module: files of folders that hold no modules."""
    folders = [path for path in folder.iterdir() if path.is_dir() and path.name != "__pycache__"]
    return {file for path in folders if not any(path.rglob("*.py")) for file in path.rglob("*") if file.is_file()}
