"""Studies of a configuration: simulated trials, or recordings of a laboratory, in the chunks that jobs take.

A chunk has whole conditions until it has enough trials, and one of more trials is divided. So another point at the end
changes the last chunk alone, and an edited value the chunk that holds it.
"""

from __future__ import annotations

import os
import re
from collections import defaultdict
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from functools import cached_property
from typing import Any, NamedTuple

from ankleloop_lab.checking import Values, check
from ankleloop_lab.recordings.settings import (
    Recording,
    describe_parts,
    name_trials,
    read_recordings,
    split_recording,
)
from ankleloop_workflow.config.files import check_cases, expand_path, key_error
from ankleloop_workflow.config.points import Point, list_points
from ankleloop_workflow.config.settings import Config, RecordingsStudy, SimulationStudy

MAX_SAMPLES = 2**25  # of all trials of a trial file, about, which then has 2 GB
ROUNDING = 1e-9  # of a sum of shares


class PointTrials(NamedTuple):
    """Trials of one condition: those numbered from `first` to `stop`, without `stop`."""

    condition: str
    first: int
    stop: int


Chunk = list[PointTrials]


class Study:
    """A study under its name."""

    varied: Sequence[str] = ()  # names of the columns that differ between the points
    # Settings of each point, or mapping of each recording, by name.
    points: Mapping[str, Mapping[str, Any]]
    chunks: Sequence[Any]

    def __init__(self, name: str, settings: Any) -> None:
        self.name = name
        self.settings = settings
        self.methods = settings.methods
        words = re.sub("[_-]+", " ", name).strip()
        self.title: str = settings.title or words[:1].upper() + words[1:]  # heading of its report
        # For legends.
        self.labels = {key: method.label or key for key, method in self.methods.items()}

    def describe(self) -> Values:
        """What its pages, the article, the ledger and the list of results take of it."""
        return {
            "study": self.name,
            "title": self.title,
            "kind": self.settings.kind,
            "points": self.points,
            "varied": list(self.varied),  # settings that differ between points
            "labels": self.labels,
            # Of each method its name in the registry.
            "algorithms": {name: method.method for name, method in self.methods.items()},
            "figure": self.settings.figure.model_dump(),  # what figures of single trials show
        }


class SimulatedStudy(Study):
    """A study of simulated trials.

    Trials of a trial file (`trial_files`; none where no trials are kept) have equal length, rate and variables. Their
    number follows from the simulation alone: another method or option simulates nothing again. A chunk (`chunks`),
    which one job identifies, is part of a trial file; without trial files the length and rate of its trials may differ.
    """

    settings: SimulationStudy

    def __init__(self, name: str, settings: SimulationStudy) -> None:
        super().__init__(name, settings)
        self.point_list, self.conditions, self.parameters = list_points(
            name, settings.points, settings.simulation, settings.methods
        )
        self.varied = list(self.parameters)
        # All settings and varied options of each point.
        self.points = {
            point.name: {**self.conditions[point.condition], **point.values}
            for point in self.point_list
        }
        # Of the table of its trials.
        self.rows = len(self.point_list) * len(settings.methods) * settings.trials
        self._points_of: dict[str, list[Point]] = defaultdict(list)  # by condition
        for point in self.point_list:
            self._points_of[point.condition].append(point)
        self.identified_methods = {
            name: {"method": method.method, "options": method.identify_options}
            for name, method in settings.methods.items()
        }
        trials = [PointTrials(name, 0, settings.trials) for name in self.conditions]
        self.trial_files: list[Chunk] = []
        if settings.keep == "everything":
            self.trial_files = split_trials(trials, self._most_in_file, self._variables_of)
        self.chunks: list[Chunk] = []
        self.file_numbers: list[int] = []  # of the trial file that holds each chunk
        for number, part in enumerate(self.trial_files or [trials]):
            chunks = split_trials(part, self._most_in_chunk)
            self.chunks += chunks
            self.file_numbers += [number] * len(chunks)

    def describe(self) -> Values:
        """The same, with what all points share, and how many trials there are at each."""
        settings = self.settings
        return {
            **super().describe(),
            **settings.model_dump(include={"simulation", "sweep", "seed"}),
            "trials_per_point": settings.trials,
        }

    def _most_in_file(self, condition: str) -> int:
        """Most trials of a trial file that are like those of a condition."""
        settings = self.conditions[condition]
        samples = round(settings["duration"] * settings["recording_rate"])
        return min(self.settings.trials_per_chunk, MAX_SAMPLES // samples)

    def _most_in_chunk(self, condition: str) -> int:
        """Most trials of a chunk that are identified at as many points as those of a condition."""
        return self.settings.trials_per_chunk // len(self._points_of[condition])

    def _variables_of(self, condition: str) -> Hashable:
        """What the trials of a file have in common: length, rate and variables."""
        settings = self.conditions[condition]
        cyclic = ("movement", "locked_torque", "perturbation_locked")
        follows_cycle = any(settings[name] for name in cyclic)
        variation = settings["variation"]
        return settings["duration"], settings["recording_rate"], variation, follows_cycle

    def simulation(self, parts: Chunk) -> Values:
        """Arguments of `simulate_trials` for a chunk or a trial file: conditions with the trials that are simulated."""
        conditions = {
            condition: {"settings": self.conditions[condition], "first": first, "stop": stop}
            for condition, first, stop in parts
        }
        return {"seed": self.settings.seed, "conditions": conditions}

    def identification(self, chunk: int) -> Values:
        """Arguments of `identify_trials` for a chunk, besides the trials and the files.

        `simulation` makes the trials; it is empty where they are read from a trial file.
        """
        conditions = {}
        parts = self.chunks[chunk]
        for condition, first, stop in parts:
            points = {
                point.name: {"values": point.values, "options": point.options}
                for point in self._points_of[condition]
            }
            conditions[condition] = {"first": first, "stop": stop, "points": points}
        return {
            "simulation": {} if self.trial_files else self.simulation(parts),
            "conditions": conditions,
            "methods": self.identified_methods,
            "kinds": {name: parameter.kind for name, parameter in self.parameters.items()},
            **self.settings.model_dump(include={"against", "precision"}),
        }

    def prediction(self, draws: Mapping[str, int]) -> Values:
        """Arguments of `predict` besides the file and the study, for numbers of seeds by the kind of prediction."""
        points = {point.name: self.conditions[point.condition] for point in self.point_list}
        return {"points": points, "draws": draws}


def split_trials(
    trials: Iterable[PointTrials],
    most: Callable[[str], int],
    label: Callable[[str], Hashable] = lambda _: None,
) -> list[Chunk]:
    """Chunks of trials whose conditions have one label: whole conditions until there are enough trials.

    `most` is the number of trials of a chunk that has such a condition alone; a condition of more trials is divided.
    """
    chunks: list[Chunk] = []
    filling: dict[Hashable, Chunk] = {}  # the last chunk of each label
    filled: dict[Hashable, float] = {}  # share of it that is taken
    for part in trials:
        condition, first, stop = part
        size = max(1, most(condition))
        key = label(condition)
        share = (stop - first) / size
        if share > 1.0:
            starts = range(first, stop, size)
            chunks += [[PointTrials(condition, k, min(k + size, stop))] for k in starts]
        elif filled.get(key, 1.0) + share > 1.0 + ROUNDING:
            filling[key] = [part]
            filled[key] = share
            chunks.append(filling[key])
        else:
            filling[key].append(part)
            filled[key] += share
    return chunks


class RecordedStudy(Study):
    """A study of recordings of a laboratory."""

    settings: RecordingsStudy

    def __init__(self, name: str, settings: RecordingsStudy) -> None:
        super().__init__(name, settings)
        self.analysed_methods = {name: method.analysed for name, method in settings.methods.items()}

    @cached_property
    def points(self) -> dict[str, Values]:  # type: ignore[override]
        """Mapping of each recording by its name, with paths and mappings of all its files as `paths` and `parts`."""
        settings = self.settings
        place = ("studies", self.name)
        folder = expand_path(settings.folder, f"study {self.name}: the folder of its recordings")
        recordings: dict[str, list[Recording]] = {}
        for stem, recording in settings.files.items():
            for name, trial in name_trials(stem, split_recording(recording, folder)).items():
                if name in recordings:
                    raise key_error((*place, "files"), f"two recordings are called {name!r}.")
                recordings[name] = [trial]
        if settings.table:
            path = expand_path(settings.table, f"study {self.name}: the table of its recordings")
            for name, parts in read_recordings(path, settings.shared, folder).items():
                if name in recordings:
                    raise key_error(
                        place,
                        f"the recording {name!r} is under files and in the table {settings.table}.",
                    )
                recordings[name] = parts
        if not recordings:
            raise key_error(place, "name its recordings under files, or a table that lists them.")
        check_cases("files", recordings)
        return {name: describe_parts(parts, folder) for name, parts in recordings.items()}

    @cached_property
    def chunks(self) -> list[dict[str, Values]]:  # type: ignore[override]
        """Mapping of each recording of each chunk by its name."""
        items = list(self.points.items())
        count = self.settings.recordings_per_chunk
        return [dict(items[first : first + count]) for first in range(0, len(items), count)]

    def analysis(self, chunk: int) -> Values:
        """Arguments of `analyse_recordings` for a chunk, besides the folder and the index."""
        return {
            "recordings": self.chunks[chunk],
            "methods": self.analysed_methods,
            "window": self.settings.figure.model_dump(include={"start", "length"}),
        }

    def check_files(self) -> None:
        """Refuse a folder that has none of the files, and names that Snakemake would take for wildcards."""
        place = ("studies", self.name)
        paths = []
        for name, point in self.points.items():
            for path in point["paths"]:
                paths.append(path)
                if re.search("[{}]", path):
                    raise key_error(
                        (*place, "files"),
                        f"the recording {name}: Snakemake takes the braces of {path} for wildcards: rename it.",
                    )
        if not any(map(os.path.exists, paths)):
            first = os.path.abspath(paths[0])
            raise key_error(
                (*place, "folder"),
                f"none of its {len(paths)} files exists; the first would be {first}.",
            )

    def existing_paths(self, chunk: int) -> list[str]:
        """Files of a chunk that exist: a missing one is refused by its job, and stops no other recording."""
        mappings = self.chunks[chunk].values()
        paths = [path for mapping in mappings for path in mapping["paths"]]
        given = [part["apparatus"] for mapping in mappings for part in mapping["parts"]]
        paths += dict.fromkeys(path for path in given if path is not None)
        return [path for path in paths if os.path.exists(path)]


def read_studies(config: Mapping[str, Any]) -> tuple[Config, dict[str, Study]]:
    """Check a configuration, fill in its defaults, and build its studies.

    Those that are not run are checked as well, but for files and tables, which they may lack.
    """
    checked = check(Config, config, "config")
    studies: dict[str, Study] = {}
    for name, settings in checked.studies.items():
        if isinstance(settings, RecordingsStudy):
            studies[name] = RecordedStudy(name, settings)
            continue
        has_table = isinstance(settings.points, Mapping) and "table" in settings.points
        if name in checked.run_names or not has_table:
            studies[name] = SimulatedStudy(name, settings)
    return checked, studies
