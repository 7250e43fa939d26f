"""Fingerprint of the library code that a script or notebook uses.

Snakemake reruns a job when its script changes, not when a module that the script imports does. So each job carries
this fingerprint as a parameter: it covers the modules of the library that the script reaches, and no others.
"""

import ast
import hashlib
import json
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parent.parent
LIBRARY = ROOT / "src"
PACKAGE = "ankleloop"


def fingerprint(script):
    """Hash of all library modules that a script or notebook (path from the repository root) imports, however deep."""
    seen, waiting = {}, _imports(ROOT / script)
    while waiting:
        path = waiting.pop()
        if path not in seen:
            seen[path] = hashlib.sha256(path.read_bytes()).hexdigest()
            waiting |= _imports(path)
    listed = "".join(f"{path.relative_to(LIBRARY)} {digest}\n" for path, digest in sorted(seen.items()))
    return hashlib.sha256(listed.encode()).hexdigest()[:16]


def _source(path):
    text = path.read_text(encoding="utf-8")
    if path.suffix != ".ipynb":
        return text
    cells = json.loads(text)["cells"]
    return "\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "code")


@cache
def _parsed(path, modified):
    return frozenset(_find(ast.parse(_source(path))))


def _imports(path):
    return set(_parsed(path, path.stat().st_mtime_ns))


def _find(tree):
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            names = [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
        else:
            continue
        for name in names:
            if name.split(".")[0] == PACKAGE:
                yield from _files(name)


def _files(name):
    """File of a module, or the __init__ of a package; names of functions have none. The package itself is all of it."""
    if name == PACKAGE:  # it imports its modules when they are asked for, which its source does not show
        yield from (LIBRARY / PACKAGE).rglob("*.py")
        return
    path = LIBRARY.joinpath(*name.split("."))
    for candidate in (path.with_suffix(".py"), path / "__init__.py"):
        if candidate.is_file():
            yield candidate
