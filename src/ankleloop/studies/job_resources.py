"""Memory and time of the jobs of a run, of which a scheduler is told."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

from ankleloop.studies import resources
from ankleloop.studies.point_chunks import PointTrials
from ankleloop.studies.study import RecordedStudy, SimulatedStudy, Study


class JobResources(NamedTuple):
    """What a job should take: memory [MB], and time of the processor [s]."""

    memory: float
    seconds: float

    def mem_mb(self, attempt: int) -> int:
        """Memory to ask for [MB]."""
        return resources.requested_mb(self.memory, attempt)

    def runtime(self, attempt: int) -> int:
        """Time to ask for [min]."""
        return resources.requested_minutes(self.seconds, attempt)


def describe_chunk(study: Study, rule: str, chunk: int) -> JobResources:
    """Resources of the job of a chunk."""
    if isinstance(study, RecordedStudy):
        return _describe_recordings(study, chunk)
    assert isinstance(study, SimulatedStudy)
    parts = study.trial_chunks[chunk] if rule == "simulate" else study.chunks[chunk]
    longest = max(_samples(study, part) for part in parts)
    seconds, memory = resources.START_SECONDS, 0.0
    if rule in ("simulate", "sweep"):
        seconds += sum(_trials(part) * resources.simulation_seconds(_samples(study, part)) for part in parts)
        memory = resources.simulation_memory(longest)
    if rule in ("identify", "sweep"):
        seconds += sum(_trials(part) * _identification_seconds(study, part) for part in parts)
        trials = sum(map(_trials, parts))
        estimates = 0.0 if study.settings.keep == "scores" else _estimates(study, parts) / trials
        memory = max(memory, resources.identification_memory(longest, trials, estimates))
    return JobResources(memory, seconds)


def describe_tables(studies: Iterable[Study]) -> JobResources:
    """Resources of a job that reads the tables of some studies: a notebook, the ledger, the article."""
    rows = sum(_rows(study) for study in studies)
    return JobResources(resources.report_memory(rows), resources.report_seconds(rows))


def _rows(study: Study) -> int:
    """Rows of the tables of parameters of a study."""
    if isinstance(study, SimulatedStudy):
        return len(study.point_list) * study.settings.trials * len(study.methods)
    return sum(map(len, study.chunks)) * len(study.methods)


def _samples(study: SimulatedStudy, part: PointTrials) -> float:
    settings = study.conditions[part.condition]
    return float(settings["duration"] * settings["recording_rate"])


def _trials(part: PointTrials) -> int:
    return part.stop - part.first


def _estimates(study: SimulatedStudy, parts: Sequence[PointTrials]) -> int:
    return sum(_trials(part) * len(study.points_of(part)) for part in parts) * len(study.methods)


def _identification_seconds(study: SimulatedStudy, part: PointTrials) -> float:
    """Time in which a trial of a condition is identified by every method, with all options of its points [s]."""
    methods: dict[Any, dict[str, Any]] = {}
    for name, method in study.identified_methods.items():
        for point in study.points_of(part):
            varied = point.options.get(name, {})
            methods[name, *varied.items()] = {**method, "options": {**method["options"], **varied}}
    rate = study.conditions[part.condition]["recording_rate"]
    return resources.identification_seconds(_samples(study, part), methods, rate)


def _describe_recordings(study: RecordedStudy, chunk: int) -> JobResources:
    sizes = [
        sum(os.path.getsize(path) for path in study.paths(name) if os.path.exists(path)) for name in study.chunks[chunk]
    ]
    return JobResources(resources.recording_memory(max(sizes)), resources.recording_seconds(len(sizes)))
