"""Where results come from: version, commit, packages and machine; all results of a run as a Research Object Crate."""

from __future__ import annotations

import hashlib
import mimetypes
import os
import platform
import subprocess
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import ankleloop
from ankleloop.trials.files import atomic_file

METADATA = "ro-crate-metadata.json"
PROFILE = "https://w3id.org/ro/wfrun/process/0.5"  # Process Run Crate: one action, from objects to results
LICENCE = "https://spdx.org/licenses/MIT"
TITLE = "Results of ankleloop: intrinsic and reflex joint stiffness identified in closed loop"
# Of suffixes that the tables of most systems do not have.
FORMATS = {".nc": "application/x-netcdf", ".md": "text/markdown", ".parquet": "application/vnd.apache.parquet"}


@dataclass(frozen=True)
class Provenance:
    """What a result was made with."""

    version: str  # version of ankleloop
    commit: str  # commit of the repository; empty where it is no working copy of git
    changed: bool  # whether files of the working copy differ from that commit
    python: str  # version of Python
    system: str  # operating system and kind of processor
    packages: dict[str, str]  # version of each distribution of the environment, by its name

    def __str__(self) -> str:
        commit = f", commit {self.commit[:12]}{' with changes' * self.changed}" if self.commit else ""
        return f"ankleloop {self.version}{commit}, Python {self.python}, {self.system}"


def read_provenance(root: str | os.PathLike[str]) -> Provenance:
    """Read version, commit, packages and machine."""
    commit = _ask_git(root, "rev-parse", "HEAD") if os.path.exists(os.path.join(root, ".git")) else ""
    names = {d.metadata["Name"]: d.version for d in metadata.distributions() if d.metadata["Name"]}
    return Provenance(
        version=ankleloop.__version__,
        commit=commit,
        changed=bool(commit) and bool(_ask_git(root, "status", "--porcelain", "--untracked-files=no")),
        python=platform.python_version(),
        system=f"{platform.system()} {platform.release()} on {platform.machine()}",
        packages={name: names[name] for name in sorted(names, key=str.lower)},
    )


def _ask_git(root: str | os.PathLike[str], *arguments: str) -> str:
    """Answer of git; empty where it has none, or there is no git."""
    command = ["git", "--no-optional-locks", "-C", os.fspath(root), *arguments]
    try:
        process = subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return process.stdout.strip() if process.returncode == 0 else ""


def write_crate(
    folder: Path, outputs: Iterable[str], configuration: Path, provenance: Provenance, seeds: Mapping[str, int]
) -> None:
    """Write the metadata of a run beside its results."""
    from rocrate.rocrate import ROCrate  # here: a package of the workflow, which the library does without

    crate = ROCrate()
    crate.name, crate.license = TITLE, LICENCE
    crate.description = f"Made by {provenance}."
    crate.root_dataset["conformsTo"] = _add(crate, PROFILE, "CreativeWork", name="Process Run Crate", version="0.5")
    settings = _add_file(crate, folder, configuration, "Configuration of the run, with all defaults")
    settings["variableMeasured"] = [
        _add(crate, f"#seed-{name}", "PropertyValue", name=f"seed of the study {name}", value=seed)
        for name, seed in seeds.items()
    ]
    files = sorted({file for output in map(Path, outputs) for file in [output, *output.rglob("*")] if file.is_file()})
    ended = max(file.stat().st_mtime for file in [configuration, *files])
    crate.add_action(
        _add_software(crate, provenance),
        identifier="#run",
        object=[settings],
        result=[_add_file(crate, folder, file) for file in files if file != configuration],
        properties={"name": "Run of the workflow", "endTime": datetime.fromtimestamp(ended, UTC).isoformat()},
    )
    with TemporaryDirectory() as temporary, atomic_file(folder / METADATA, overwrite=True) as partial:
        crate.metadata.write(temporary)
        partial.write_bytes((Path(temporary) / METADATA).read_bytes())


def hash_file(path: Path) -> str:
    """Hash of a file by SHA-256, as hexadecimal digits."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _add(crate: Any, identifier: str, kind: str, **properties: Any) -> Any:
    from rocrate.model.contextentity import ContextEntity

    return crate.add(ContextEntity(crate, identifier, properties={"@type": kind, **properties}))


def _add_software(crate: Any, provenance: Provenance) -> Any:
    """The program, with the packages of its environment."""
    version = f"{provenance.version}+{provenance.commit}" if provenance.commit else provenance.version
    packages = {"Python": provenance.python, **provenance.packages}
    return _add(
        crate,
        "#ankleloop",
        "SoftwareApplication",
        name="ankleloop",
        softwareVersion=version + " with changes that are not committed" * provenance.changed,
        operatingSystem=provenance.system,
        license=LICENCE,
        softwareRequirements=[
            _add(crate, f"#package-{name}", "SoftwareApplication", name=name, softwareVersion=version)
            for name, version in packages.items()
            if name != "ankleloop"
        ],
    )


def _add_file(crate: Any, folder: Path, path: Path, name: str = "") -> Any:
    relative = path.relative_to(folder).as_posix()
    properties = {
        "name": name or relative,
        "encodingFormat": FORMATS.get(path.suffix) or mimetypes.guess_type(path.name)[0] or "application/octet-stream",
        "contentSize": str(path.stat().st_size),
        "sha256": hash_file(path),
    }
    return crate.add_file(path, dest_path=relative, properties=properties)
