"""Studies of a configuration: simulated trials, or recordings of a laboratory, in the chunks that jobs take.

A chunk has a power of two of trials of one condition, or of conditions, so that its size changes seldom: another point
at the end changes the last chunk alone, and chunks of identification are parts of trial files.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import re
from collections.abc import Callable, Hashable, Mapping, Sequence
from functools import cached_property
from typing import Any, NamedTuple

from ankleloop.studies.checking import check, check_cases, expand_path, key_error
from ankleloop.studies.config import NOTEBOOKS, Config, RecordingsStudy, SimulationStudy
from ankleloop.studies.points import Point, list_points
from ankleloop.studies.recording_settings import read_recordings
from ankleloop.studies.resources import (
    RECORDING_SECONDS,
    START_SECONDS,
    identification_seconds,
    simulation_seconds,
)

MAX_SAMPLES = 2**25  # of all trials of a trial file, about, which then has 2 GB


class PointTrials(NamedTuple):
    """Trials of one condition: those numbered from `first` to `stop`, without `stop`."""

    condition: str
    first: int
    stop: int


Chunk = list[PointTrials]
Parts = list[tuple[Any, PointTrials]]  # each with what those of a chunk share


class Study:
    """A study under its name."""

    varied: Sequence[str] = ()  # names of the columns that differ between the points
    points: Mapping[
        str, Mapping[str, Any]
    ]  # settings of each point, or mapping of each recording, by name
    chunks: Sequence[Any]

    def __init__(self, name: str, settings: Any) -> None:
        self.name, self.settings, self.methods = name, settings, settings.methods
        words = re.sub("[_-]+", " ", name).strip()
        self.title: str = settings.title or words[:1].upper() + words[1:]  # heading of its report
        self.labels = {
            name: method.label or name for name, method in self.methods.items()
        }  # for legends
        names = NOTEBOOKS[settings.notebook].figures if settings.notebook else ()
        has_singular_values = any(
            method.method.endswith("moesp") for method in self.methods.values()
        )
        self.figures = tuple(name for name in names if name != "order" or has_singular_values)


class SimulatedStudy(Study):
    """A study of simulated trials.

    Trials of a trial file (`trial_chunks`; none where no trials are kept) have equal length, rate and variables. Their
    number follows from the simulation alone: another method or option simulates nothing again. Trials of a chunk
    (`chunks`), which one job identifies, belong to one trial file; without these their length and rate may differ.
    """

    settings: SimulationStudy

    def __init__(self, name: str, settings: SimulationStudy) -> None:
        super().__init__(name, settings)
        points = list_points(name, settings.points, settings.simulation, settings.methods)
        self.point_list, self.conditions, self.parameters = points
        conditions = self.conditions.items()
        self._samples = {
            name: round(part["duration"] * part["recording_rate"]) for name, part in conditions
        }
        self.varied = list(self.parameters)
        # All settings and varied options of each point.
        self.points = {
            point.name: {**self.conditions[point.condition], **point.values}
            for point in self.point_list
        }
        self.rows = (
            len(self.point_list) * len(settings.methods) * settings.trials
        )  # of the table of its trials
        self._points_of: dict[str, list[Point]] = {condition: [] for condition in self.conditions}
        for point in self.point_list:
            self._points_of[point.condition].append(point)
        self.identified_methods = {
            name: {"method": method.method, "options": method.identify_options}
            for name, method in settings.methods.items()
        }
        target = 60.0 * settings.job_minutes
        self._job_seconds = max(target - START_SECONDS, target / 2)  # of a job without its start
        parts = self._list_trials()
        self.trial_chunks: list[Chunk] = []
        if settings.keep == "everything":
            self.trial_chunks = [chunk for _, chunk in self._divide(parts, self._simulation_cost)]
            ranks = {condition: rank for rank, condition in enumerate(self.conditions)}
            parts = [
                (number, part) for number, chunk in enumerate(self.trial_chunks) for part in chunk
            ]
            parts.sort(key=lambda row: (ranks[row[1].condition], row[1].first))
        divided = self._divide(parts, self._cost)
        self.chunks: list[Chunk] = [chunk for _, chunk in divided]
        self.trial_chunk_numbers = [
            label for label, _ in divided
        ]  # of the trial file that holds each chunk

    def simulation(self, parts: Chunk) -> dict[str, Any]:
        """Arguments of `simulate_trials` for a chunk or a trial file: conditions with the trials that are simulated."""
        conditions = {
            condition: {"settings": self.conditions[condition], "first": first, "stop": stop}
            for condition, first, stop in parts
        }
        return {"seed": self.settings.seed, "conditions": conditions}

    def identification(self, chunk: int) -> dict[str, Any]:
        """Arguments of `identify_trials` for a chunk, besides the trials and the files."""
        conditions, parts = {}, self.chunks[chunk]
        for condition, first, stop in parts:
            points = {
                p.name: {"values": p.values, "options": p.options}
                for p in self._points_of[condition]
            }
            conditions[condition] = {"first": first, "stop": stop, "points": points}
        arguments = {
            "conditions": conditions,
            "methods": self.identified_methods,
            "kinds": {name: parameter.kind for name, parameter in self.parameters.items()},
            **self.settings.model_dump(include={"against", "precision"}),
        }
        return {**arguments, "settings": _hash(self.name, self.simulation(parts), arguments)}

    @cached_property
    def hashes(self) -> list[str]:
        """Hash of the settings that make the table of each chunk."""
        return [self.identification(chunk)["settings"] for chunk in range(len(self.chunks))]

    @property
    def hash(self) -> str:
        """Hash of the settings that make the table of the study."""
        return _hash(*self.hashes)

    def simulation_seconds(self, parts: Chunk) -> float:
        """Time of a job that simulates a chunk [s]."""
        return START_SECONDS + sum(
            (stop - first) * simulation_seconds(self._samples[c]) for c, first, stop in parts
        )

    def identification_seconds(self, parts: Chunk) -> float:
        """Time of a job that identifies a chunk, and simulates it where no trials are kept [s]."""
        return START_SECONDS + sum(
            (stop - first) * self._cost(condition) for condition, first, stop in parts
        )

    def _list_trials(self) -> Parts:
        """All trials of each condition, with what those of a file share: length, rate and variables."""
        parts: Parts = []
        for condition, settings in self.conditions.items():
            follows_cycle = any(
                settings[name] for name in ("movement", "locked_torque", "perturbation_locked")
            )
            label = (
                settings["duration"],
                settings["recording_rate"],
                settings["variation"],
                follows_cycle,
            )
            trials = PointTrials(condition, 0, self.settings.trials)
            parts.append((None if self.settings.keep == "scores" else label, trials))
        return parts

    def _simulation_cost(self, condition: str) -> float:
        """Time in which a trial is simulated, or more where a trial file would become too large [s]."""
        samples = self._samples[condition]
        return max(simulation_seconds(samples), self._job_seconds * samples / MAX_SAMPLES)

    def _cost(self, condition: str) -> float:
        """Time in which a trial is identified at all points, and simulated where none is kept [s].

        Options that vary count by their number and not by their values: an edited value must not move other trials to
        other chunks.
        """
        points, samples = self._points_of[condition], self._samples[condition]
        counts = {
            name: len({tuple(p.options.get(name, {}).items()) for p in points})
            for name in self.methods
        }
        methods = [
            self.identified_methods[name] for name, count in counts.items() for _ in range(count)
        ]
        cost = identification_seconds(
            samples, methods, self.conditions[condition]["recording_rate"]
        )
        return cost + simulation_seconds(samples) * (self.settings.keep != "everything")

    def _chunk_size(self, seconds: float) -> tuple[int, int]:
        """Most trials of one condition, and most conditions, in a chunk whose trials take some time each."""
        settings = self.settings
        if settings.trials_per_chunk:
            return settings.trials_per_chunk, 1
        count = 2 ** round(math.log2(max(self._job_seconds / seconds, 1.0)))  # nearest power of two
        if count < settings.trials:
            return count, 1
        return settings.trials, 1 << (count // settings.trials).bit_length() - 1

    def _divide(self, parts: Parts, seconds: Callable[[str], float]) -> list[tuple[Any, Chunk]]:
        """Chunks of parts with one label, of the size that the configuration sets or that fits; in one pass."""
        chunks: list[tuple[Any, Chunk]] = []
        last: dict[Hashable, Chunk] = {}
        for label, part in parts:
            trials, conditions = self._chunk_size(seconds(part.condition))
            if trials < part.stop - part.first:
                for first in range(part.first, part.stop, trials):
                    chunks.append(
                        (label, [part._replace(first=first, stop=min(first + trials, part.stop))])
                    )
            else:
                key = (label, trials, conditions)
                if len(last.get(key, ())) in (0, conditions):
                    last[key] = []
                    chunks.append((label, last[key]))
                last[key].append(part)
        return chunks


def _hash(*values: Any) -> str:
    """Hash of settings, by which a result knows what made it."""
    return hashlib.sha256(json.dumps(values, sort_keys=True, default=str).encode()).hexdigest()[:16]


class RecordedStudy(Study):
    """A study of recordings of a laboratory."""

    settings: RecordingsStudy

    def __init__(self, name: str, settings: RecordingsStudy) -> None:
        super().__init__(name, settings)
        self.analysed_methods = {  # for `ankleloop.recordings.analysis.analyse`
            name: {**method.model_dump(exclude={"options"}), "options": method.fixed_options}
            for name, method in settings.methods.items()
        }

    @cached_property
    def hashes(self) -> list[str]:
        """Hash of the settings that make the table of each chunk."""
        shared = (self.analysed_methods, self.settings.figure.model_dump())
        return [_hash(chunk, *shared) for chunk in self.chunks]

    @cached_property
    def points(self) -> dict[str, dict[str, Any]]:  # type: ignore[override]
        """Mapping of each recording by its name, with paths and mappings of all its files as `paths` and `parts`."""
        settings, place = self.settings, ("studies", self.name)
        recordings = {name: [recording] for name, recording in settings.files.items()}
        if settings.table:
            path = expand_path(settings.table, f"study {self.name}: the table of its recordings")
            for name, parts in read_recordings(path, settings.shared).items():
                if name in recordings:
                    raise key_error(
                        place,
                        f"the recording {name!r} is under files and in the table {settings.table}.",
                    )
                recordings[name] = parts
        if not recordings:
            raise key_error(place, "name its recordings under files, or a table that lists them.")
        check_cases("files", recordings)
        folder = expand_path(settings.folder, f"study {self.name}: the folder of its recordings")
        return {
            name: {
                **parts[0].model_dump(),
                "paths": [str(folder / part.file) for part in parts],
                "parts": [part.model_dump() for part in parts],
            }
            for name, parts in recordings.items()
        }

    @cached_property
    def chunks(self) -> list[dict[str, dict[str, Any]]]:  # type: ignore[override]
        """Mapping of each recording of each chunk by its name."""
        items, count = list(self.points.items()), self.settings.recordings_per_chunk
        return [dict(items[first : first + count]) for first in range(0, len(items), count)]

    def check_files(self) -> None:
        """Refuse a folder that has none of the files."""
        paths = [path for point in self.points.values() for path in point["paths"]]
        if not any(map(os.path.exists, paths)):
            message = f"none of its {len(paths)} files exists; the first would be {os.path.abspath(paths[0])}."
            raise key_error(("studies", self.name, "folder"), message)

    def existing_paths(self, chunk: int) -> list[str]:
        """Files of a chunk that exist: a missing one is refused by its job, and stops no other recording."""
        paths = [path for mapping in self.chunks[chunk].values() for path in mapping["paths"]]
        return list(filter(os.path.exists, paths))

    def seconds(self, chunk: int) -> float:
        """Time of the job of a chunk [s]."""
        return START_SECONDS + RECORDING_SECONDS * len(self.chunks[chunk])


def read_studies(config: Mapping[str, Any]) -> tuple[Config, dict[str, Study]]:
    """Check a configuration, fill in its defaults, and build its studies.

    Those that are not run are checked as well, but for files and tables, which they may lack.
    """
    checked = check(Config, config, "config")
    studies: dict[str, Study] = {}
    for name, settings in checked.studies.items():
        if isinstance(settings, RecordingsStudy):
            studies[name] = RecordedStudy(name, settings)
        elif name in checked.run_names or not (
            isinstance(settings.points, Mapping) and "table" in settings.points
        ):
            studies[name] = SimulatedStudy(name, settings)
    return checked, studies
