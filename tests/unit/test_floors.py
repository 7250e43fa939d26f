"""The floors of docs/architecture.md: each module imports from lower floors only, and never in circles."""

import ast
import json
import re
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
ARCHITECTURE = ROOT / "docs" / "architecture.md"
PACKAGE = "ankleloop"
OUTSIDE = ("workflow", "notebooks", "tests", "benchmarks")  # what the library must never import


# --- reading the table


def read_floors(text):
    """Floor of every room: rows `| 1 | `signals` `subspace` | … |` of a Markdown table."""
    floors = {}
    for line in text.splitlines():
        cells = [cell.strip() for cell in line.strip().strip("|").split("|")]
        if len(cells) < 2 or not cells[0].isdigit():
            continue
        for room in re.findall(r"`([^`]+)`", cells[1]):
            room = room.rstrip("/").removesuffix(".py").replace("/", ".").removeprefix(f"{PACKAGE}.")
            if room in floors:
                raise ValueError(f"{room} is listed twice")
            floors[room] = int(cells[0])
    return floors


def room_of(module, floors):
    """The listed name that covers a module: its own, or the nearest package's; None if there is none."""
    while module and module not in floors:
        module = module.rpartition(".")[0]
    return module or None


# --- reading the code


def library_modules(source):
    """Path of every module by its name relative to the package; the root package is ''."""
    modules = {}
    for path in sorted(Path(source).rglob("*.py")):
        parts = path.relative_to(source).with_suffix("").parts
        modules[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return modules


def imports_of(code, package=None):
    """Absolute names that code imports, at any depth; `package` is where relative imports start."""
    for node in ast.walk(ast.parse(code)):
        if isinstance(node, ast.Import):
            yield from ((alias.name, None) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                parents = package.split(".")[: len(package.split(".")) - node.level + 1]
                base = ".".join([*parents, base] if base else parents)
            yield from ((base, alias.name) for alias in node.names)


def resolve(base, name, modules):
    """Module of the library that an import reaches, relative to the package; None for other people's modules."""
    if base != PACKAGE and not base.startswith(f"{PACKAGE}."):
        return None
    inner = base[len(PACKAGE) + 1 :]
    submodule = f"{inner}.{name}".lstrip(".") if name else inner
    return submodule if submodule in modules else inner


def import_graph(source):
    """Modules of the library, and for each the modules of the library that it imports."""
    modules = library_modules(source)
    graph = {}
    for module, path in modules.items():
        dotted = f"{PACKAGE}.{module}" if module else PACKAGE
        package = dotted if path.name == "__init__.py" else dotted.rpartition(".")[0]
        reached = {resolve(base, name, modules) for base, name in imports_of(path.read_text(), package)}
        graph[module] = reached - {None, module}
    return graph


# --- the rules


def find_cycle(graph):
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return " → ".join(name or PACKAGE for name in reversed(error.args[1]))
    return None


def violations(graph, floors):
    """Imports that go up, to the public face or in a circle on one floor, and modules without a floor."""
    found, same_floor = [], {}
    for module in sorted(set(graph) - {""}):
        room = room_of(module, floors)
        if room is None:
            found.append(f"{module} is on no floor")
            continue
        for target in sorted(graph[module]):
            if target == "":
                found.append(f"{module} imports the public face")
                continue
            other = room_of(target, floors)
            if other is None or other == room:
                continue
            if floors[other] > floors[room]:
                found.append(f"{module} (floor {floors[room]}) imports {target} (floor {floors[other]})")
            elif floors[other] == floors[room]:
                same_floor.setdefault(room, set()).add(other)
    cycle = find_cycle(same_floor)
    return [*found, f"circle on one floor: {cycle}"] if cycle else found


# --- the library keeps them


@pytest.fixture(scope="module")
def floors():
    assert ARCHITECTURE.is_file(), f"{ARCHITECTURE} is missing"
    return read_floors(ARCHITECTURE.read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def graph():
    return import_graph(ROOT / "src" / PACKAGE)


def test_the_graph_holds_the_library(graph):
    assert {"", "errors", "subspace", "subspace.moesp", "methods.moesp", "registry"} <= set(graph)
    assert {"errors", "subspace.moesp", "estimate", "regressors"} <= graph["methods.moesp"]
    assert graph["errors"] == set()


def test_every_module_has_a_floor(graph, floors):
    assert [module for module in graph if module and room_of(module, floors) is None] == []


def test_every_listed_room_exists(graph, floors):
    assert sorted(set(floors) - set(graph)) == []


def test_imports_go_down(graph, floors):
    assert violations(graph, floors) == []


def test_no_two_modules_import_each_other(graph):
    """Imports inside functions count as well."""
    assert find_cycle(graph) is None


def test_the_library_does_not_know_who_uses_it():
    scripts = {path.stem for folder in OUTSIDE for path in (ROOT / folder).rglob("*.py")}
    found = []
    for module, path in library_modules(ROOT / "src" / PACKAGE).items():
        top = {base.partition(".")[0] for base, _ in imports_of(path.read_text(), f"{PACKAGE}.x") if base}
        found += [f"{module} imports {name}" for name in sorted(top & {*OUTSIDE, "snakemake", "papermill", *scripts})]
    assert found == []


# --- workflow and notebooks


def notebook_code(path):
    """Python of all code cells, without magics."""
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    lines = "\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "code").splitlines()
    return "\n".join(line for line in lines if not line.lstrip().startswith(("%", "!")))


def snakefile_code(path):
    """The import statements of a Snakefile, which is not quite Python, and its modules' names."""
    pattern = r"^(?:from\s+\S+\s+import\s+(?:\([^)]*\)|[^\n(]+)|import\s+[^\n]+)"
    return "\n".join(re.findall(pattern, path.read_text(encoding="utf-8"), flags=re.MULTILINE))


def users():
    """Every file that uses the library, with the code that shows its imports."""
    found = {path: path.read_text(encoding="utf-8") for path in (ROOT / "workflow").rglob("*.py")}
    found |= {path: notebook_code(path) for path in (ROOT / "notebooks").rglob("*.ipynb")}
    found |= {path: path.read_text(encoding="utf-8") for path in (ROOT / "notebooks").rglob("*.py")}
    snakefiles = [*(ROOT / "workflow").rglob("*.smk"), *ROOT.glob("Snakefile")]
    return found | {path: snakefile_code(path) for path in snakefiles}


def misplaced_imports(path, code, modules):
    """What a file of the workflow or a notebook imports of this repository beside the library.

    The workflow may share helpers of its own; a notebook stands alone.
    """
    local = {file.stem for folder in OUTSIDE for file in (ROOT / folder).rglob("*.py")} | {"src", *OUTSIDE}
    if path.relative_to(ROOT).parts[0] in ("workflow", "Snakefile"):
        local -= {file.stem for file in (ROOT / "workflow").rglob("*.py")}
    found = []
    for base, name in imports_of(code, "workflow.scripts"):
        if base.partition(".")[0] in local:
            found.append(f"{path.name} imports {base}")
        inner = resolve(base, name, modules)
        if inner is not None and inner not in modules:
            found.append(f"{path.name} imports {base}, which the library does not have")
    return found


def test_workflow_and_notebooks_import_the_library_alone():
    modules = library_modules(ROOT / "src" / PACKAGE)
    files = users()
    assert any(path.suffix == ".ipynb" for path in files)
    assert any(path.parent.name == "scripts" for path in files)
    assert [line for path, code in files.items() for line in misplaced_imports(path, code, modules)] == []


# --- the rules find what they are for

TABLE = """
| floor | rooms | what lives there |
|---|---|---|
| 0 | `errors` | `DataError` |
| 1 | `signals` · `subspace/` hankel, moesp | linear |
| 1 | `basis.py` | |
| 2 | `ankleloop.trial` | |

The paper's 3 methods | `nothing` |
"""


def write_library(folder, **modules):
    for name, code in modules.items():
        path = folder / (name.replace("__", "/") + ".py" if name != "face" else "__init__.py")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(code)
        if path.parent != folder and not (path.parent / "__init__.py").exists():
            (path.parent / "__init__.py").write_text("")
    return import_graph(folder)


def test_reading_the_table():
    assert read_floors(TABLE) == {"errors": 0, "signals": 1, "subspace": 1, "basis": 1, "trial": 2}
    assert room_of("subspace.moesp", read_floors(TABLE)) == "subspace"
    assert room_of("subspaces", read_floors(TABLE)) is None
    with pytest.raises(ValueError, match="errors is listed twice"):
        read_floors(TABLE + "| 3 | `errors` | |")


@pytest.mark.parametrize(
    "line",
    [
        "import ankleloop.trial",
        "from ankleloop import trial",
        "from ankleloop.trial import new_trial",
        "from ankleloop.trial import *",
        "from . import trial",
        "from .trial import new_trial",
        "def later():\n    from ankleloop.trial import new_trial",
        "if True:\n    import ankleloop.trial as t",
    ],
)
def test_an_import_upwards_is_found_in_every_form(tmp_path, line):
    graph = write_library(tmp_path, signals=line, trial="")
    assert violations(graph, read_floors(TABLE)) == ["signals (floor 1) imports trial (floor 2)"]
    assert violations(write_library(tmp_path / "down", trial=line.replace("trial", "errors"), errors=""),
                      read_floors(TABLE)) == []  # fmt: skip


def test_relative_imports_inside_a_package(tmp_path):
    graph = write_library(
        tmp_path, subspace__moesp="from .hankel import x\nfrom ..errors import E", subspace__hankel="", errors=""
    )
    assert graph["subspace.moesp"] == {"subspace.hankel", "errors"}
    assert violations(graph, read_floors(TABLE)) == []


def test_one_floor_may_share_but_not_in_a_circle(tmp_path):
    one_way = write_library(tmp_path / "a", signals="import ankleloop.basis", basis="")
    assert violations(one_way, read_floors(TABLE)) == []
    # No two modules import each other here, but two rooms do.
    rooms = write_library(
        tmp_path / "b",
        signals="import ankleloop.subspace.hankel",
        subspace__hankel="",
        subspace__moesp="import ankleloop.signals",
    )
    assert find_cycle(rooms) is None
    (found,) = violations(rooms, read_floors(TABLE))
    assert found.startswith("circle on one floor: ")
    assert {"signals", "subspace"} <= set(re.findall(r"\w+", found))


def test_circles_are_found_inside_functions_and_packages(tmp_path):
    graph = write_library(
        tmp_path,
        subspace__moesp="from ankleloop.subspace.hankel import x",
        subspace__hankel="def later():\n    from ankleloop.subspace import moesp",
    )
    assert violations(graph, read_floors(TABLE)) == []
    assert "subspace.moesp" in find_cycle(graph)


def test_the_public_face_and_unlisted_rooms_are_found(tmp_path):
    graph = write_library(tmp_path, face="from ankleloop.signals import x", signals="import ankleloop", attic="")
    assert violations(graph, read_floors(TABLE)) == ["attic is on no floor", "signals imports the public face"]
    assert find_cycle(graph) is not None


def test_misplaced_imports_are_found():
    modules = {"": None, "estimate": None}
    notebook, script = ROOT / "notebooks" / "x.ipynb", ROOT / "workflow" / "scripts" / "x.py"
    helper = next(path.stem for path in (ROOT / "workflow" / "scripts").glob("*.py"))
    assert misplaced_imports(notebook, "from ankleloop.estimate import E\nimport numpy, ankleloop", modules) == []
    assert misplaced_imports(notebook, f"import {helper}", modules) == [f"x.ipynb imports {helper}"]
    assert misplaced_imports(script, f"import {helper}", modules) == []
    assert misplaced_imports(script, "from tests.unit import test_trial", modules) == ["x.py imports tests.unit"]
    assert misplaced_imports(script, "from src.ankleloop import estimate", modules) == ["x.py imports src.ankleloop"]
    (found,) = misplaced_imports(script, "from ankleloop.attic import x", modules)
    assert "which the library does not have" in found
