"""Studies of simulations: the points of each, its trials in chunks; all studies of a configuration."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cached_property
from typing import Any

from ankleloop.studies.checking import ConfigError, check
from ankleloop.studies.config import MAX_JOBS, Config, SimulationStudy
from ankleloop.studies.point_chunks import ChunkSize, PointTrials, divide_points, divide_trials, fit_size
from ankleloop.studies.point_parameters import Parameter
from ankleloop.studies.points import Point, Points, list_points
from ankleloop.studies.recorded_study import RecordedStudy
from ankleloop.studies.resources import START_SECONDS, identification_seconds, simulation_seconds
from ankleloop.studies.study_base import Study

MAX_SAMPLES = 2**25  # of all trials of a trial file, which then has at most 2 GB


class SimulatedStudy(Study):
    """A study of simulated trials."""

    settings: SimulationStudy

    @cached_property
    def _points(self) -> Points:
        return list_points(self.name, self.settings.points, self.settings.simulation, self.settings.methods)

    @property
    def has_table(self) -> bool:
        """Whether a table lists its points."""
        return isinstance(self.settings.points, Mapping) and "table" in self.settings.points

    @property
    def point_list(self) -> list[Point]:
        """Points with their values."""
        return self._points.points

    @property
    def conditions(self) -> dict[str, dict[str, Any]]:
        """All settings of each condition, by its name: what trials are simulated with."""
        return self._points.conditions

    @cached_property
    def points(self) -> dict[str, dict[str, Any]]:
        """All settings and varied options of each point, by its name."""
        return {point.name: {**self.conditions[point.condition], **point.values} for point in self.point_list}

    @property
    def parameters(self) -> dict[str, Parameter]:
        """Settings and options that differ between the points, by the names of their columns."""
        return self._points.parameters

    @property
    def varied(self) -> list[str]:
        """Names of the columns of the settings and options that differ between the points."""
        return list(self.parameters)

    @cached_property
    def points_of_conditions(self) -> dict[str, list[Point]]:
        """Points of each condition, by its name."""
        points: dict[str, list[Point]] = {}
        for point in self.point_list:
            points.setdefault(point.condition, []).append(point)
        return points

    def points_of(self, part: PointTrials) -> list[Point]:
        """Points at which trials of a chunk are identified."""
        points = self.points_of_conditions[part.condition]
        return points if part.points is None else points[slice(*part.points)]

    @cached_property
    def trial_chunks(self) -> list[list[PointTrials]]:
        """Trials of each trial file, which have equal length, rate and variables; none where no trials are kept.

        Their size follows from the simulation alone: another method or option simulates nothing again.
        """
        if self.settings.keep != "everything":
            return []
        trials = self.settings.trials

        def fit(condition: str) -> ChunkSize:
            samples = self._samples(condition)
            return fit_size(simulation_seconds(samples), self._job_seconds, trials, MAX_SAMPLES // samples)

        return [chunk for _, chunk in self._divide(self._all_trials(equal=True), fit)]

    @cached_property
    def _chunks(self) -> list[tuple[Any, list[PointTrials]]]:
        """Chunks, each with the number of its trial file and the points of its conditions."""
        trials, stored = self.settings.trials, self.settings.keep == "everything"
        slices = {condition: self._divide_points(condition) for condition in self.conditions}

        def fit(condition: str) -> ChunkSize:
            cost = self._identification_seconds(condition, slices[condition][0])
            if not stored:
                cost += simulation_seconds(self._samples(condition))
            return fit_size(cost, self._job_seconds, trials)

        if stored:
            ranks = {condition: rank for rank, condition in enumerate(self.conditions)}
            parts = [(number, part) for number, chunk in enumerate(self.trial_chunks) for part in chunk]
            parts.sort(key=lambda row: (ranks[row[1].condition], row[1].first))
        else:
            parts = self._all_trials(equal=self.settings.keep == "estimates")
        sliced = [
            ((label, points), part._replace(points=points))
            for label, part in parts
            for points in slices[part.condition]
        ]
        return self._divide(sliced, fit)

    @cached_property
    def chunks(self) -> list[list[PointTrials]]:
        """Trials of each chunk, which one job identifies: those of some conditions, or part of those of one condition.

        Of a condition with many points, a chunk may also have part of these. The trials belong to one trial file. Only
        without trial files and estimates their length and rate may differ. Another point at the end changes the last
        chunk alone.
        """
        return [chunk for _, chunk in self._chunks]

    def trial_chunk_of(self, chunk: int) -> int:
        """Number of the trial file that holds the trials of a chunk."""
        return int(self._chunks[chunk][0][0])

    def simulated_points(self, chunk: int, *, stored: bool = False) -> dict[str, dict[str, Any]]:
        """Conditions of a chunk, or of a trial file, with their settings and the trials that are simulated."""
        parts = (self.trial_chunks if stored else self.chunks)[chunk]
        return {
            part.condition: {"settings": self.conditions[part.condition], "first": part.first, "stop": part.stop}
            for part in parts
        }

    def identified_trials(self, chunk: int) -> dict[str, list[int]]:
        """First and last number (without the last) of the trials of each condition of a chunk."""
        return {part.condition: [part.first, part.stop] for part in self.chunks[chunk]}

    def identified_points(self, chunk: int) -> dict[str, dict[str, dict[str, Any]]]:
        """Points of each condition of a chunk, with their `values` and their `options` by method."""
        return {
            part.condition: {
                point.name: {"values": point.values, "options": point.options} for point in self.points_of(part)
            }
            for part in self.chunks[chunk]
        }

    @cached_property
    def identified_methods(self) -> dict[str, dict[str, Any]]:
        """Methods with all their options, which those of a point override, for `identify_chunk`."""
        return {
            name: {"method": method.method, "options": method.identify_options} for name, method in self.methods.items()
        }

    def simulation_arguments(self, number: int) -> dict[str, Any]:
        """What the job of a trial file passes to `simulate_chunk`, besides the file and the name of the study."""
        points = self.simulated_points(number, stored=True)
        return {"seed": self.settings.seed, "points": points, **self._options("precision", "failures")}

    def identification_arguments(self, chunk: int) -> dict[str, Any]:
        """What the job of a chunk passes to `identify_chunk`, besides the files and the name of the study."""
        return {
            "points": self.identified_points(chunk),
            "methods": self.identified_methods,
            "trials": self.identified_trials(chunk),
            **self._options("against", "precision", "failures"),
        }

    def sweep_arguments(self, chunk: int) -> dict[str, Any]:
        """What the job of a chunk passes to `sweep_chunk`, besides the files and the name of the study."""
        return {
            "seed": self.settings.seed,
            "conditions": self.simulated_points(chunk),
            "points": self.identified_points(chunk),
            "methods": self.identified_methods,
            **self._options("against", "precision", "failures"),
        }

    def _options(self, *names: str) -> dict[str, Any]:
        return {name: getattr(self.settings, name) for name in names}

    def simulated_time(self, chunk: int, *, stored: bool = False) -> float:
        """Length of all trials of a chunk, or of a trial file, together [s]."""
        parts = (self.trial_chunks if stored else self.chunks)[chunk]
        return float(sum(self.conditions[part.condition]["duration"] * (part.stop - part.first) for part in parts))

    @property
    def _job_seconds(self) -> float:
        """Time of a job without its start [s]."""
        target = 60.0 * self.settings.job_minutes
        return max(target - START_SECONDS, target / 2)

    def _samples(self, condition: str) -> int:
        """Samples of a trial."""
        settings = self.conditions[condition]
        return round(settings["duration"] * settings["recording_rate"])

    def _all_trials(self, *, equal: bool) -> list[tuple[Any, PointTrials]]:
        """Trials of each condition, with what those of a chunk have to share where a file holds them."""
        trials = self.settings.trials
        return [
            (_file_label(settings) if equal else None, PointTrials(condition, 0, trials))
            for condition, settings in self.conditions.items()
        ]

    @cached_property
    def _costs(self) -> dict[Any, float]:
        """Time in which a trial is identified [s], by its length, its rate and the number of options of each method."""
        return {}

    def _divide_points(self, condition: str) -> list[tuple[int, int] | None]:
        """Parts of the points of a condition that are identified by different jobs; None for all of them."""
        if self._fixed_size[1] is not None:
            return [None]
        cost = self._identification_seconds(condition, (0, 1))
        return divide_points(len(self.points_of_conditions[condition]), cost * self.settings.trials, self._job_seconds)

    def _identification_seconds(self, condition: str, part: tuple[int, int] | None) -> float:
        """Time in which a trial of a condition is identified by every method, at some or all of its points [s].

        Options that vary count by their number and not by their values: an edited value must not move other trials to
        other chunks.
        """
        settings = self.conditions[condition]
        points = self.points_of(PointTrials(condition, 0, 0, part))
        counts = tuple(
            len({tuple(point.options.get(name, {}).items()) for point in points}) if len(points) > 1 else 1
            for name in self.methods
        )
        key = (settings["duration"], settings["recording_rate"], counts)
        if key not in self._costs:
            methods = {
                f"{name} {number}": method
                for (name, method), count in zip(self.identified_methods.items(), counts, strict=True)
                for number in range(count)
            }
            self._costs[key] = identification_seconds(self._samples(condition), methods, settings["recording_rate"])
        return self._costs[key]

    @property
    def _fixed_size(self) -> tuple[str, ChunkSize | None]:
        """Key of the configuration that decides on the size of chunks, and that size if it is set there."""
        trials, points = self.settings.trials_per_chunk, self.settings.points_per_chunk
        if trials is not None:
            return "trials_per_chunk", ChunkSize(trials)
        if points is not None:
            return "points_per_chunk", ChunkSize(self.settings.trials, points)
        return "job_minutes", None

    def _divide(
        self, parts: list[tuple[Any, PointTrials]], fit: Callable[[str], ChunkSize]
    ) -> list[tuple[Any, list[PointTrials]]]:
        """Chunks of the size that the configuration sets, or of one that fits."""
        key, fixed = self._fixed_size
        sizes = {part.condition: fixed or fit(part.condition) for _, part in parts}
        jobs = sum(-(-(part.stop - part.first) // sizes[part.condition].trials) for _, part in parts)
        most = max(size.conditions for size in sizes.values())
        if jobs > MAX_JOBS * most:
            raise ConfigError(
                f"config → studies → {self.name}: {jobs // most:,} chunks are more than {MAX_JOBS:,}: increase {key}.",
                ("studies", self.name, key),
            )
        return divide_trials(parts, sizes.__getitem__)


def _file_label(settings: Mapping[str, Any]) -> tuple[Any, ...]:
    """Length, rate and variables of trials, which are equal in a trial file."""
    follows_cycle = any(settings[name] for name in ("movement", "locked_torque", "perturbation_locked"))
    return settings["duration"], settings["recording_rate"], settings["variation"], follows_cycle


def read_studies(config: Mapping[str, Any]) -> tuple[Config, dict[str, Study]]:
    """Check a configuration, fill in its defaults, and build its studies."""
    checked = check(Config, config, "config")
    studies: dict[str, Study] = {
        name: SimulatedStudy(name, settings) if isinstance(settings, SimulationStudy) else RecordedStudy(name, settings)
        for name, settings in checked.studies.items()
    }
    for name, study in studies.items():
        # The settings of every point are checked here, and every row of a table, which only its own run needs.
        if name in checked.run_names or (isinstance(study, SimulatedStudy) and not study.has_table):
            study.chunks  # noqa: B018
    return checked, studies
