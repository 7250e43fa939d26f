"""The results of a run as a Research Object Crate: what was made, from which configuration, by which programs."""

from __future__ import annotations

import hashlib
import mimetypes
import os
from collections.abc import Iterable, Mapping
from datetime import UTC, datetime
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from ankleloop.studies.provenance import Provenance
from ankleloop.trials.files import atomic_file

METADATA = "ro-crate-metadata.json"
PROFILE = "https://w3id.org/ro/wfrun/process/0.5"  # Process Run Crate: one action, from objects to results
LICENCE = "https://spdx.org/licenses/MIT"
TITLE = "Results of ankleloop: intrinsic and reflex joint stiffness identified in closed loop"
# Of suffixes that the tables of most systems do not have.
FORMATS = {".nc": "application/x-netcdf", ".md": "text/markdown", ".parquet": "application/vnd.apache.parquet"}


def write_crate(
    folder: str | os.PathLike[str],
    outputs: Iterable[str | os.PathLike[str]],
    configuration: str | os.PathLike[str],
    provenance: Provenance,
    seeds: Mapping[str, int],
) -> None:
    """Write the metadata of a run beside its results."""
    from rocrate.rocrate import ROCrate  # here: a package of the workflow, which the library does without

    folder = Path(folder)
    crate = ROCrate()
    crate.name, crate.license = TITLE, LICENCE
    crate.description = f"Made by {provenance}."
    crate.root_dataset["conformsTo"] = _add(crate, PROFILE, "CreativeWork", name="Process Run Crate", version="0.5")
    software = _add_software(crate, provenance)
    settings = _add_file(crate, folder, Path(configuration), "Configuration of the run, with all defaults")
    settings["variableMeasured"] = [
        _add(crate, f"#seed-{name}", "PropertyValue", name=f"seed of the study {name}", value=seed)
        for name, seed in seeds.items()
    ]
    files = sorted({file for output in outputs for file in _list_files(Path(output))})
    results = [_add_file(crate, folder, file) for file in files if file != Path(configuration)]
    ended = max((file.stat().st_mtime for file in files), default=Path(configuration).stat().st_mtime)
    crate.add_action(
        software,
        identifier="#run",
        object=[settings],
        result=results,
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
    changes = " with changes that are not committed" if provenance.changed else ""
    packages = {"Python": provenance.python, **provenance.packages}
    return _add(
        crate,
        "#ankleloop",
        "SoftwareApplication",
        name="ankleloop",
        softwareVersion=f"{version}{changes}",
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
    kind = FORMATS.get(path.suffix) or mimetypes.guess_type(path.name)[0] or "application/octet-stream"
    properties = {
        "name": name or relative,
        "encodingFormat": kind,
        "contentSize": str(path.stat().st_size),
        "sha256": hash_file(path),
    }
    return crate.add_file(path, dest_path=relative, properties=properties)


def _list_files(path: Path) -> list[Path]:
    return [file for file in path.rglob("*") if file.is_file()] if path.is_dir() else [path]
