"""The library code behind the script of a job.

Snakemake runs a job again when its script changes, not when a module that the script imports does. So each job carries
a fingerprint as a parameter: it covers the modules of the library that the script reaches, and no others, the versions
of the packages that compute, and those of packages that register methods, if it reaches the registry.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterable
from functools import cache
from pathlib import Path

from ankleloop.methods.entry_points import list_packages
from ankleloop.trials.files import PathLike
from ankleloop_workflow.tables.versions import read_versions

PACKAGES = ("ankleloop", "ankleloop_lab", "ankleloop_workflow")
LIBRARY = Path(__file__).parents[2]  # folder of the packages
REGISTRY = LIBRARY / "ankleloop" / "methods" / "registry.py"
# How an estimate is drawn and put into words changes no number: these imports of a module are not followed.
LEFT_OUT = {
    "ankleloop/joint/estimate.py": {
        "ankleloop.plotting.estimates",
        "ankleloop.methods.description",
    }
}
# Regular expressions, because the syntax trees of a hundred modules would take longer than Snakemake's own start. They
# also find what looks like an import in a text: then a job runs once more than it has to, and none is missed.
IMPORT = re.compile(
    r"^[ \t]*(?:from[ \t]+([\w.]+)[ \t]+import[ \t]+(\([^)]*\)|[^\n;]*)|import[ \t]+([^\n;]*))",
    re.MULTILINE,
)


def fingerprint(*scripts: PathLike) -> str:
    """Hash of all library files that scripts or notebooks reach, directly or through other modules.

    A module is reached by an import, at the top or within a function, and a data file, as a template, by its name in a
    file that is reached. Packages that compute count by their versions, and those that register methods, for scripts
    that reach the registry: the provenance of results, written at their end, then holds for all of them.
    """
    digest = hashlib.sha256()
    for package, version in read_versions().items():
        digest.update(f"{package} {version}\n".encode())
    files = reached_files(*scripts)
    for path in sorted(files):
        digest.update(f"{path.relative_to(LIBRARY)} {hash_file(path)}\n".encode())
    if REGISTRY in files:
        for package in list_packages():
            digest.update(f"{package}\n".encode())
    return digest.hexdigest()[:16]


def reached_files(*scripts: PathLike) -> set[Path]:
    """Library files that scripts, notebooks or modules reach, directly or through other modules."""
    modules: set[Path] = set()
    remaining = {file for script in scripts for file in _parse(Path(script))}
    while remaining:
        path = remaining.pop()
        modules.add(path)
        remaining |= _parse(path) - modules
    return modules | _find_data({*map(Path, scripts), *modules})


def _find_data(files: set[Path]) -> set[Path]:
    """Data files of the library that files name, directly or through other data files."""
    data: set[Path] = set()
    while files:
        files = {file for path in files for file in _find_named(path, LIBRARY)} - data
        data |= files
    return data


@cache
def _find_named(path: Path, library: Path) -> frozenset[Path]:
    """Data files of the library that a file names."""
    text = path.read_text(encoding="utf-8")
    return frozenset(data for data in _list_data(library) if data.name in text)


@cache
def _list_data(library: Path) -> frozenset[Path]:
    """Files of the library which are no modules."""
    paths = (path for package in PACKAGES for path in (library / package).rglob("*"))
    return frozenset(
        path
        for path in paths
        if path.is_file() and path.suffix != ".py" and path.parent.name != "__pycache__"
    )


@cache
def hash_file(path: Path) -> str:
    """Hash of a file by SHA-256, as hexadecimal digits."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


@cache
def _parse(path: Path) -> frozenset[Path]:
    """Library files that a script, notebook or module refers to."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".ipynb":
        cells = [cell for cell in json.loads(text)["cells"] if cell["cell_type"] == "code"]
        text = "\n".join("".join(cell["source"]) for cell in cells)
    names = set()
    for source, members, modules in IMPORT.findall(text):  # and aliases, which are no modules
        names |= {source, *re.findall(r"[\w.]+", modules)}
        names |= {f"{source}.{name}" for name in re.findall(r"\w+", members)}
    if path.is_relative_to(LIBRARY):
        names -= LEFT_OUT.get(path.relative_to(LIBRARY).as_posix(), set())
    return frozenset(file for name in names for file in _find_files(name))


def _find_files(name: str) -> Iterable[Path]:
    """File of a module, or the __init__ of a package; other names have none."""
    if name.partition(".")[0] not in PACKAGES:
        return ()
    path = LIBRARY.joinpath(*name.split("."))
    return filter(Path.is_file, (path.with_suffix(".py"), path / "__init__.py"))
