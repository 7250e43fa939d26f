"""Studies of recordings of a laboratory: their files, in chunks."""

from __future__ import annotations

import os
from functools import cached_property
from pathlib import Path
from typing import Any

from ankleloop.studies.checking import ConfigError, expand_path
from ankleloop.studies.config import Recording, RecordingsStudy
from ankleloop.studies.recording_tables import read_recordings
from ankleloop.studies.study_base import Study


class RecordedStudy(Study):
    """A study of recordings of a laboratory."""

    settings: RecordingsStudy

    @cached_property
    def recordings(self) -> dict[str, list[Recording]]:
        """Files of each recording by its name: one, or those of the trials that are merged."""
        recordings = {name: [recording] for name, recording in self.settings.files.items()}
        if self.settings.table:
            path = expand_path(self.settings.table, f"study {self.name}: the table of its recordings")
            listed = read_recordings(path, self.settings.shared)
            for name in recordings:
                if name in listed:
                    raise ConfigError(
                        f"study {self.name}: the recording {name!r} is under files ({recordings[name][0].file}) and in "
                        f"the table {self.settings.table} ({listed[name][0].file}): give one of them another name.",
                        ("studies", self.name, "files", name),
                    )
            recordings |= listed
        if not recordings:
            raise ConfigError(
                f"study {self.name}: name its recordings under files, or a table that lists them.",
                ("studies", self.name),
            )
        return recordings

    @cached_property
    def points(self) -> dict[str, dict[str, Any]]:
        """Mapping of each recording, by its name."""
        return {name: parts[0].model_dump() for name, parts in self.recordings.items()}

    @cached_property
    def chunks(self) -> list[list[str]]:
        """Names of the recordings of each chunk."""
        names, count = list(self.recordings), self.settings.recordings_per_chunk
        return [names[first : first + count] for first in range(0, len(names), count)]

    @cached_property
    def folder(self) -> Path:
        """Folder of the files."""
        return expand_path(self.settings.folder, f"study {self.name}: the folder of its recordings")

    def check_files(self) -> None:
        """Refuse a folder that does not exist or has none of the files, and paths that Snakemake cannot use."""
        keys = ("studies", self.name, "folder")
        folder = Path(os.path.abspath(self.folder))
        place = f"study {self.name}: the folder of its recordings, {folder},"
        if not os.path.isdir(folder):
            what = "is a file" if os.path.exists(folder) else "does not exist"
            raise ConfigError(f"{place} {what}: check the key folder, or the variable that it names.", keys)
        paths = [path for name in self.recordings for path in self.paths(name)]
        for path in paths:
            if "{" in path or "}" in path:
                raise ConfigError(
                    f"study {self.name}: the path {path} has braces, which Snakemake takes for a wildcard: rename it.",
                    ("studies", self.name),
                )
        if not any(map(os.path.exists, paths)):
            raise ConfigError(f"{place} has none of its {len(paths)} files; the first would be {paths[0]}.", keys)

    def paths(self, name: str) -> list[str]:
        """Paths of all files of a recording."""
        return [str(self.folder / part.file) for part in self.recordings[name]]

    def existing_paths(self, chunk: int) -> list[str]:
        """Files of a chunk that exist: a missing one is refused by its job, and stops no other recording."""
        return [path for name in self.chunks[chunk] for path in self.paths(name) if os.path.exists(path)]

    @property
    def analysed_methods(self) -> dict[str, dict[str, Any]]:
        """Methods with their labels, options and selections, for `ankleloop.recordings.analysis.analyse`."""
        return {
            name: {**method.model_dump(exclude={"options"}), "options": method.fixed_options}
            for name, method in self.methods.items()
        }

    def mappings(self, chunk: int) -> dict[str, dict[str, Any]]:
        """Mapping of each recording of a chunk, with paths and mappings of all its files as `paths` and `parts`."""
        return {
            name: {
                **self.points[name],
                "paths": self.paths(name),
                "parts": [part.model_dump() for part in self.recordings[name]],
            }
            for name in self.chunks[chunk]
        }
