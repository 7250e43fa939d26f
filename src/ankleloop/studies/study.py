"""Studies: the points of each, its trials in chunks, its recordings."""

from __future__ import annotations

import os
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from functools import cached_property
from itertools import groupby
from pathlib import Path
from typing import Any, NamedTuple

from ankleloop.simulation.settings import SimulationSettings
from ankleloop.studies.checking import ConfigError, check, expand_path
from ankleloop.studies.config import Config, MethodSettings, Recording, RecordingsStudy, SimulationStudy, point_name
from ankleloop.studies.recording_tables import read_recordings

__all__ = ["PointTrials", "RecordedStudy", "SimulatedStudy", "Study", "read_studies"]


class PointTrials(NamedTuple):
    """Trials of one point: those numbered from `first` to `stop`, without `stop`."""

    point: str
    first: int
    stop: int


class Study(ABC):
    """A study under its name.

    Parameters
    ----------
    name : str
        Its name.
    settings : SimulationStudy or RecordingsStudy
        Its part of the configuration.
    """

    settings: SimulationStudy | RecordingsStudy

    def __init__(self, name: str, settings: SimulationStudy | RecordingsStudy) -> None:
        self.name = name
        self.settings = settings

    @property
    def kind(self) -> str:
        """Source of its trials, "simulation" or "recordings"."""
        return self.settings.kind

    @property
    def methods(self) -> Mapping[str, MethodSettings]:
        """Methods by the name that tables use."""
        return self.settings.methods

    @property
    def labels(self) -> dict[str, str]:
        """Legend of each method."""
        return {name: method.label or name for name, method in self.methods.items()}

    @property
    @abstractmethod
    def points(self) -> dict[str, dict[str, Any]]:
        """Settings of each point, or mapping of each recording, by name."""

    @property
    @abstractmethod
    def chunks(self) -> Sequence[Sequence[Any]]:
        """Contents of each chunk."""

    @property
    def varied(self) -> list[str]:
        """Names of the settings that differ between the points."""
        return []


class SimulatedStudy(Study):
    """A study of simulated trials."""

    settings: SimulationStudy

    @cached_property
    def combinations(self) -> dict[str, dict[str, Any]]:
        """The settings that make each point, by its name."""
        return {point_name(settings): settings for settings in self.settings.points}

    @cached_property
    def points(self) -> dict[str, dict[str, Any]]:
        """All settings of each point, by its name."""
        shared = self.settings.simulation.model_dump()
        place = ("config", "studies", self.name, "points")
        points = {
            point: check(SimulationSettings, {**shared, **settings}, *place, point).model_dump()
            for point, settings in self.combinations.items()
        }
        first: dict[tuple[Any, ...], str] = {}
        for point, settings in points.items():
            other = first.setdefault(tuple(settings.values()), point)
            if other != point:
                raise ConfigError(
                    f"study {self.name}: the points {other} and {point} have the same settings.", place[1:]
                )
        return points

    @property
    def varied(self) -> list[str]:
        """Names of the settings that differ between the points."""
        return list(dict.fromkeys(name for settings in self.combinations.values() for name in settings))

    @cached_property
    def chunks(self) -> list[list[PointTrials]]:
        """Trials of each chunk: those of some points, or part of the trials of one point.

        The trials of a chunk have equal length and rate. Another point at the end changes the last chunk alone.
        """
        trials, part = self.settings.trials, self.settings.trials_per_chunk
        if part is not None:
            return [
                [PointTrials(point, first, min(first + part, trials))]
                for point in self.points
                for first in range(0, trials, part)
            ]
        count = self.settings.points_per_chunk
        chunks = []
        for _, alike in groupby(self.points.items(), lambda item: (item[1]["duration"], item[1]["recording_rate"])):
            points = [point for point, _ in alike]
            chunks += [points[first : first + count] for first in range(0, len(points), count)]
        return [[PointTrials(point, 0, trials) for point in points] for points in chunks]

    def simulated_points(self, chunk: int) -> dict[str, dict[str, Any]]:
        """Points of a chunk with their settings and the trials that are simulated, for `simulate_chunk`."""
        return {
            point: {"settings": self.points[point], "first": first, "stop": stop}
            for point, first, stop in self.chunks[chunk]
        }

    def varied_settings(self, chunk: int) -> dict[str, dict[str, Any]]:
        """Points of a chunk with the settings that make them, for `identify_chunk`."""
        return {part.point: self.combinations[part.point] for part in self.chunks[chunk]}

    @property
    def identified_methods(self) -> dict[str, dict[str, Any]]:
        """Methods with all their options, for `identify_chunk`."""
        return {
            name: {"method": method.method, "options": method.identify_options} for name, method in self.methods.items()
        }

    def simulated_time(self, chunk: int) -> float:
        """Length of all trials of a chunk together [s], to which the time of its jobs is about proportional."""
        return sum(self.points[point]["duration"] * (stop - first) for point, first, stop in self.chunks[chunk])


class RecordedStudy(Study):
    """A study of recordings of a laboratory."""

    settings: RecordingsStudy

    @cached_property
    def recordings(self) -> dict[str, list[Recording]]:
        """Files of each recording by its name: one, or those of the trials that are merged.

        Raises
        ------
        ConfigError
            If there are none, or the table that lists them has a mistake.
        """
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
        """Folder of the files.

        Raises
        ------
        ConfigError
            If it is named by an environment variable that is not set, or is empty.
        """
        return expand_path(self.settings.folder, f"study {self.name}: the folder of its recordings")

    def check_files(self) -> None:
        """Refuse a folder that does not exist or has none of the files, and paths that Snakemake cannot use.

        Raises
        ------
        ConfigError
            The message names the folder.
        """
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


def read_studies(config: Mapping[str, Any]) -> tuple[Config, dict[str, Study]]:
    """Check a configuration, fill in its defaults, and build its studies.

    Parameters
    ----------
    config : mapping
        The configuration, as its files give it; it is not changed.

    Returns
    -------
    config : Config
        The configuration with all defaults.
    studies : dict of str to Study
        Its studies by name.

    Raises
    ------
    ConfigError
        For an unknown or missing key, or a value out of its range; the message names the key.
    """
    checked = check(Config, config, "config")
    studies: dict[str, Study] = {
        name: SimulatedStudy(name, settings) if isinstance(settings, SimulationStudy) else RecordedStudy(name, settings)
        for name, settings in checked.studies.items()
    }
    for name, study in studies.items():
        # The settings of every point are checked here, and every row of a table, which only its own run needs.
        if isinstance(study, SimulatedStudy) or name in checked.run_names:
            study.chunks  # noqa: B018
    return checked, studies
