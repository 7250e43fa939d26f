"""A run as a Workflow Run Crate: the workflow, what it read, what it made, and by whom and when; and its archive.

`python -m ankleloop_workflow.jobs.crate results results.zip` packs a crate into one file.
"""

from __future__ import annotations

import json
import mimetypes
import shutil
import sys
import time
from collections.abc import Iterable, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any
from zipfile import ZIP_DEFLATED, ZipFile

from ankleloop.trials.files import PathLike, atomic_file
from ankleloop_workflow.jobs.fingerprint import hash_file
from ankleloop_workflow.jobs.results import METADATA, TITLE, describe_version

LICENCE = "https://spdx.org/licenses/MIT"
SOURCES = "source"  # folder of the crate with all that runs the workflow again
WORKFLOW = (
    "Snakefile",
    "Makefile",
    "README.md",
    "LICENSE",
    "pyproject.toml",
    "environment.lock",
    "workflow",
    "config",
    "data",
    "notebooks",
    "profiles",
    "src",
)
PUBLISHED = "data/published"  # numbers and claims of the paper
# Profiles of the crate, each an extension of those before it.
PROFILES = {
    "https://w3id.org/ro/wfrun/process/0.5": ("Process Run Crate", "0.5"),
    "https://w3id.org/workflowhub/workflow-ro-crate/1.0": ("Workflow RO-Crate", "1.0"),
    "https://w3id.org/ro/wfrun/workflow/0.5": ("Workflow Run Crate", "0.5"),
}


def write_crate(
    folder: Path,
    repository: Path,
    provenance: Mapping[str, Any],
    recordings: Iterable[PathLike],
    results: Iterable[PathLike],
    configurations: Iterable[PathLike] = (),
) -> None:
    """Write the metadata of a run beside its results, and copy the workflow of the repository there.

    With it go the configuration files that were given, into its folder of configurations. Recordings of a laboratory
    stay where they are; results are files, and folders of files.
    """
    # Here: a package of the workflow, which the library does without.
    from rocrate.rocrate import ROCrate

    crate = ROCrate(version="1.1")

    def add_file(path: Path) -> Any:
        relative = path.relative_to(folder).as_posix()
        return crate.add_file(path, relative, properties=_describe_file(path, relative))

    sources = folder / SOURCES
    _copy_sources(repository, sources)
    for path in configurations:
        shutil.copy2(path, sources / "config")
    workflow = crate.add_workflow(
        sources / "Snakefile",
        f"{SOURCES}/Snakefile",
        main=True,
        lang="snakemake",
        lang_version=provenance["packages"]["snakemake"],
        properties={"name": "Workflow of ankleloop", "license": LICENCE},
    )
    workflow["softwareRequirements"] = _add_program(crate, provenance)
    copies = set(_list_files([sources])) - {sources / "Snakefile"}
    entities = {path: add_file(path) for path in copies}
    configuration = folder / "configuration.json"  # with all defaults, and the seeds of the studies
    made = set(_list_files(results)) - {configuration, folder / METADATA}
    inputs = [add_file(configuration)]
    inputs += [entities[path] for path in _list_files([sources / PUBLISHED])]
    existing = filter(Path.exists, map(Path, recordings))
    # Several recordings may be parts of one file, or copies of it.
    for digest, path in {hash_file(path): path for path in existing}.items():
        properties = {"@type": "CreativeWork", **_describe_file(path, path.name)}
        inputs.append(crate.add_jsonld({"@id": f"#{digest}", **properties}))
    action = crate.add_action(
        workflow,
        "#run",
        inputs,
        [add_file(path) for path in sorted(made)],
        {
            "name": "Run of the workflow",
            "description": "Simulates or reads trials, identifies them by each method, and reports.",
            "startTime": _format_time(min(path.stat().st_mtime for path in made)),
            "endTime": _format_time(time.time()),
        },
    )
    action["agent"] = crate.add_jsonld(
        {"@id": "#agent", "@type": "Person", "name": provenance["agent"]}
    )
    root = crate.root_dataset
    root["mentions"] = action
    root["conformsTo"] = [
        crate.add_jsonld(
            {"@id": profile, "@type": "CreativeWork", "name": name, "version": version}
        )
        for profile, (name, version) in PROFILES.items()
    ]
    crate.name = TITLE
    crate.license = LICENCE
    crate.description = (
        "Figures, tables, reports and the article of one run, with the workflow that made them."
    )
    with atomic_file(folder / METADATA, overwrite=True) as partial:
        text = json.dumps(crate.metadata.generate(), indent=4, sort_keys=True, ensure_ascii=False)
        partial.write_text(text, encoding="utf-8")


def _copy_sources(repository: Path, sources: Path) -> None:
    """Copy the workflow, the library and what they read of the repository."""
    sources.mkdir(exist_ok=True)
    for name in WORKFLOW:
        origin = repository / name
        if origin.is_dir():
            ignored = shutil.ignore_patterns("__pycache__")
            shutil.copytree(origin, sources / name, ignore=ignored, dirs_exist_ok=True)
        elif origin.exists():  # a copy of the workflow may lack the lock
            shutil.copy2(origin, sources)


def _list_files(paths: Iterable[PathLike]) -> list[Path]:
    """Files, and those in folders, in the order of their names."""
    files = set()
    for path in map(Path, paths):
        files |= set(filter(Path.is_file, [path, *path.rglob("*")]))
    return sorted(files)


def _describe_file(path: Path, name: str) -> dict[str, str]:
    """Name, kind, size and hash of a file."""
    kind, _ = mimetypes.guess_type(path.name)
    return {
        "name": name,
        "encodingFormat": kind or "application/octet-stream",
        "contentSize": str(path.stat().st_size),
        "sha256": hash_file(path),
    }


def _add_program(crate: Any, provenance: Mapping[str, Any]) -> Any:
    """The library, with the packages it ran with."""
    packages = {"Python": provenance["python"], **provenance["packages"]}
    del packages["ankleloop"]
    return crate.add_jsonld(
        {
            "@id": "#ankleloop",
            "@type": "SoftwareApplication",
            "name": "ankleloop",
            "softwareVersion": describe_version(provenance),
            "operatingSystem": provenance["system"],
            "license": LICENCE,
            "softwareRequirements": [f"{name} {release}" for name, release in packages.items()],
        }
    )


def _format_time(seconds: float) -> str:
    """A time of the clock in the standard form."""
    return datetime.fromtimestamp(seconds, UTC).isoformat(timespec="seconds")


def pack_crate(folder: Path, path: Path) -> None:
    """Pack the files that the metadata of a crate list, and the metadata, into one zip file."""
    crate = json.loads((folder / METADATA).read_text(encoding="utf-8"))
    (root,) = [entity for entity in crate["@graph"] if entity["@id"] == "./"]
    names = [METADATA, *(part["@id"] for part in root["hasPart"])]
    with (
        atomic_file(path, overwrite=True) as partial,
        ZipFile(partial, "w", ZIP_DEFLATED) as archive,
    ):
        for name in names:
            archive.write(folder / name, name)


if __name__ == "__main__":
    pack_crate(Path(sys.argv[1]), Path(sys.argv[2]))
