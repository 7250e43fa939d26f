"""The configuration: every key with its type, unit, default and bounds, and errors that name the key."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Mapping
from functools import reduce
from operator import or_
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self, get_args

from pydantic import (
    BeforeValidator,
    Field,
    StringConstraints,
    WithJsonSchema,
    create_model,
    model_validator,
)

from ankleloop.methods.registry import METHODS
from ankleloop.options import Options, option
from ankleloop.records.reading_options import ReadingOptions
from ankleloop.simulation.settings import SimulationSettings

__all__ = [
    "NOTEBOOKS",
    "Config",
    "FigureSettings",
    "MethodSettings",
    "Recording",
    "RecordingsStudy",
    "SimulationStudy",
    "point_name",
]

SETTINGS = tuple(SimulationSettings.model_fields)

# Notebooks of studies, and the figures that each draws beside its page and its table.
NOTEBOOKS = {
    "table1": ("figure3", "order"),
    "figure4": ("figure4", "passes"),
    "passes": ("passes",),
    "table2": ("figure5",),
    "comparison": ("stiffness", "vaf"),
    "traces": ("traces",),
    "sensitivity": ("map",),
    "efficiency": ("efficiency", "intervals"),
    "choosing": ("choosing",),
    "obstacles": ("obstacles",),
    "recordings": ("group",),
}

Name = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]*$")]
RECORDING_NAME = r"^[A-Za-z0-9][A-Za-z0-9_.-]*$"


def _refuse_number(value: Any) -> Any:
    """Refuse what YAML has not read as text: it reads 007 as 7, 12_3 as 123, 1:30 as 90 and no as false."""
    if value is not None and not isinstance(value, str):
        raise ValueError(f"must be text, got {value!r}: put it in quotes, since YAML changes 007 to 7 and 12_3 to 123")
    return value


# Text that may look like a number.
Text = Annotated[str, BeforeValidator(_refuse_number)]
RecordingName = Annotated[str, StringConstraints(pattern=RECORDING_NAME)]


def point_name(settings: Mapping[str, Any]) -> str:
    """Name of a point in paths and tables, from the settings that make it, in any order.

    Examples
    --------
    >>> point_name({"reflex_gain": 13.0, "closed_loop": True})
    'closed_loop=True,reflex_gain=13.0'
    """
    return ",".join(f"{name}={value}" for name, value in sorted(settings.items())) or "only"


def _list_points(points: Any) -> list[dict[str, Any]]:
    """The points of a study as a list; values by name give all their combinations."""
    if isinstance(points, Mapping):
        if not all(isinstance(values, list) and values for values in points.values()):
            raise ValueError("each setting must have a list of values")
        points = [dict(zip(points, values, strict=True)) for values in itertools.product(*points.values())]
    if not isinstance(points, list) or not points or not all(isinstance(point, Mapping) for point in points):
        raise ValueError("must be lists of values by setting, or a list of points with their settings")
    for name in itertools.chain.from_iterable(points):
        if name not in SETTINGS:
            raise ValueError(f"{name!r} is not a setting of the simulation; known: {', '.join(SETTINGS)}")
    points = [{name: _as_setting(name, value) for name, value in point.items()} for point in points]
    for name, count in Counter(map(point_name, points)).items():
        if count > 1:
            raise ValueError(f"the point {name} is listed twice")
    return points


def _as_setting(name: str, value: Any) -> Any:
    """A value as the simulation has it, so that 13 and 13.0, 0.0 and -0.0 make one point with one name and one seed."""
    annotation = SimulationSettings.model_fields[name].annotation
    if float in (get_args(annotation) or (annotation,)) and type(value) in (int, float):
        return float(value) + 0.0
    return value


Points = Annotated[
    list[dict[str, Any]],
    BeforeValidator(_list_points),
    WithJsonSchema(
        {
            "anyOf": [
                {
                    "type": "object",
                    "propertyNames": {"enum": list(SETTINGS)},
                    "additionalProperties": {"type": "array", "minItems": 1, "uniqueItems": True},
                },
                {
                    "type": "array",
                    "minItems": 1,
                    "uniqueItems": True,
                    "items": {"type": "object", "propertyNames": {"enum": list(SETTINGS)}},
                },
            ]
        }
    ),
]


class FigureSettings(Options):
    """The trial and the window that figures of torques show."""

    methods: list[str] | None = option(None, "methods that are drawn, a column each; null draws all")
    trial: int = option(0, "number of the trial, from 0", ge=0)
    start: float = option(10.0, "start of the window", unit="s", ge=0)
    length: float = option(5.0, "length of the window", unit="s", gt=0)


class MethodSettings(Options):
    """A method of a study: its name, its label and its options."""

    method: str = option(description="identification method")
    label: str | None = option(None, "name in tables and legends; null for the key")
    options: Options = option(description="options of the method; those left out have their defaults")
    select: dict[str, Annotated[list[Any], Field(min_length=1)]] = option(
        {}, "options to select on data that were not fitted, each with its candidates from simple to complex"
    )
    criterion: Literal["instrumental", "cross-validation"] | None = option(
        None, "criterion of that selection; null for instrumental with a reference, cross-validation without"
    )

    @model_validator(mode="after")
    def _check_candidates(self) -> Self:
        for name, candidates in self.select.items():
            for value in candidates:
                try:
                    type(self.options).parse(f"method {self.method!r}", **{name: value})
                except (TypeError, ValueError) as error:
                    raise ValueError(f"select: {error}") from None
        return self

    @property
    def fixed_options(self) -> dict[str, Any]:
        """Options with their defaults, without those that are to be selected."""
        return {name: value for name, value in self.options if name not in self.select}

    @property
    def identify_options(self) -> dict[str, Any]:
        """All options that `ankleloop.identify` takes, the candidates of a selection among them."""
        selection = {"select": self.select, "criterion": self.criterion} if self.select else {}
        return {**self.fixed_options, **selection}


def _union_of_methods() -> Any:
    """One model of `MethodSettings` for each set of options; the name of the method tells them apart."""
    names: dict[type[Options], list[str]] = {}
    for name, entry in METHODS.items():
        names.setdefault(entry.options, []).append(name)
    method, field = (MethodSettings.model_fields[name].description or "" for name in ("method", "options"))
    models: list[Any] = [
        create_model(
            options.__name__.replace("Options", "Settings"),
            __base__=MethodSettings,
            __doc__=f"A method with {options.__name__}.",
            method=(Literal[tuple(members)], option(description=method)),  # type: ignore[arg-type] # of the registry
            options=(options, option(description=field, default_factory=options)),
        )
        for options, members in names.items()
    ]
    return Annotated[reduce(or_, models), Field(discriminator="method")]


if TYPE_CHECKING:
    Methods = dict[str, MethodSettings]
    SimulationNotebook = str
else:
    Methods = dict[Name, _union_of_methods()]
    SimulationNotebook = Literal[tuple(name for name in NOTEBOOKS if name != "recordings")]


def _figure_option() -> Any:
    return option(description="what figures of torques show", default_factory=FigureSettings)


def _methods_option() -> Any:
    return option(description="methods with their options, by the name that tables and figures use", min_length=1)


class SimulationStudy(Options):
    """A study of simulated trials."""

    kind: Literal["simulation"] = option(description="source of the trials")
    title: str = option("Simulation", "heading of the report")
    notebook: SimulationNotebook | None = option("table1", "notebook that renders the study; null for none")
    trials: int = option(20, "simulated trials at each point", ge=1, le=100000)
    seed: int = option(
        description="seed of the study; every trial has a stream of its own, keyed by study, point and trial", ge=0
    )
    simulation: SimulationSettings = option(
        description="settings of every trial; those left out have their defaults", default_factory=SimulationSettings
    )
    points: Points = option(
        description=(
            "values of settings by name, all combinations of which are points; or a list of points, each with its "
            "settings"
        ),
        default_factory=lambda: [{}],
    )
    against: Literal["measured"] | None = option(
        None,
        "what estimates are scored against; null for the true torques (and the measured net torque), measured for the "
        "measured net torque alone, as if the simulation were a recording",
    )
    failures: Literal["stop", "count"] = option(
        "count",
        "what a trial that a method cannot identify does: count as a result, which is a row of the parameters with the "
        "error as `failure` and no scores, or stop the job with its error",
    )
    precision: Literal["single", "double"] = option(
        "double",
        "floating-point precision of trials and estimated torques on disk; single takes half the space, and rounds far "
        "below a 16-bit converter",
    )
    points_per_chunk: int = option(
        1,
        "points that share a job; starting a job costs as much as fifty trials do, but a point that changes is made "
        "again with all of its chunk; points of different record length or rate do not share a chunk",
        ge=1,
    )
    trials_per_chunk: int | None = option(
        None, "trials that share a job, where the trials of one point are several jobs; null for all of a point", ge=1
    )
    figure: FigureSettings = _figure_option()
    methods: Methods = _methods_option()

    @model_validator(mode="after")
    def _check_chunks(self) -> Self:
        if self.trials_per_chunk is not None and self.points_per_chunk > 1:
            raise ValueError(
                "a chunk is some points, or part of the trials of one point: set points_per_chunk: 1 to use "
                f"trials_per_chunk, got points_per_chunk: {self.points_per_chunk}"
            )
        return self


class Recording(ReadingOptions):
    """A recording: its file, how it is read, and which part of it is used."""

    file: str = option(description="path of the file below the folder of the study (.csv, .csv.gz, .mat, .h5, .nc)")
    subject: Text = option("", "subject; groups the figures")
    condition: Text = option("", "condition; groups the figures")
    trial: Text = option("", "repetition")
    start: float | None = option(None, "start of the segment that is used; null for the beginning", unit="s", ge=0)
    stop: float | None = option(None, "end of the segment that is used; null for the end", unit="s", gt=0)
    drift: int = option(0, "degree of the polynomial that is taken out of the torque; 0 takes the mean", ge=0, le=10)


class RecordingsStudy(Options):
    """A study of recordings of a laboratory."""

    kind: Literal["recordings"] = option(description="source of the trials")
    title: str = option("Recordings", "heading of the report")
    notebook: Literal["recordings"] | None = option("recordings", "notebook that renders the study; null for none")
    folder: str = option(".", "folder of the files; ${NAME} stands for an environment variable")
    files: dict[RecordingName, Recording] = option(
        description="recordings by name; the name appears in the paths of the results", default_factory=dict
    )
    shared: dict[str, Any] = option(
        description="values for every recording that does not give its own, by the keys of a recording",
        alias="defaults",
        default_factory=dict,
    )
    table: str | None = option(
        None,
        "CSV file that lists recordings, a row each, with the columns of a recording and an optional name; null for "
        "none. Without a name, subject, condition and trial make it",
    )
    recordings_per_chunk: int = option(8, "recordings that share a job", ge=1)
    figure: FigureSettings = _figure_option()
    methods: Methods = _methods_option()

    @model_validator(mode="before")
    @classmethod
    def _apply_defaults(cls, values: Any) -> Any:
        if not isinstance(values, Mapping):
            return values
        defaults, files = (values.get(name) or {} for name in ("defaults", "files"))
        if not isinstance(defaults, Mapping) or not isinstance(files, Mapping):
            return values
        if "file" in defaults:
            raise ValueError("defaults: the key 'file' has no default, since every recording has a file of its own")
        complete = {
            name: {**defaults, **mapping} if isinstance(mapping, Mapping) else mapping
            for name, mapping in files.items()
        }
        return {**values, "files": complete}

    @model_validator(mode="after")
    def _check_labels(self) -> Self:
        """Results of a recording are told apart by the labels of their methods."""
        labels = Counter(method.label or name for name, method in self.methods.items())
        for label, count in labels.items():
            if count > 1:
                raise ValueError(f"methods: {count} methods have the label {label!r}; give each one of its own")
        return self


StudySettings = SimulationStudy | RecordingsStudy


class Config(Options):
    """The whole configuration."""

    run: list[str] | None = option(None, "names of the studies to make; null for all of them")
    article: list[str] = option(
        description=(
            "names of the simulated studies that the ledger and the article are made of; both are made where all of "
            "these are run"
        ),
        default_factory=list,
    )
    studies: dict[Name, Annotated[StudySettings, Field(discriminator="kind")]] = option(
        description="studies by name; the name appears in the paths of the results", min_length=1
    )

    @property
    def run_names(self) -> list[str]:
        """Names of the studies to make."""
        return list(self.studies) if self.run is None else self.run

    @property
    def article_names(self) -> list[str]:
        """Names of the studies of the article; none where one of them is not made."""
        return self.article if set(self.article) <= set(self.run_names) else []

    @model_validator(mode="after")
    def _check_names(self) -> Self:
        for key, names in (("run", self.run or ()), ("article", self.article)):
            for name in names:
                if name not in self.studies:
                    raise ValueError(f"{key}: there is no study {name!r}; there are {', '.join(self.studies)}")
        for name in self.article_names:
            study = self.studies[name]
            if not isinstance(study, SimulationStudy) or study.notebook is None:
                raise ValueError(f"article: the study {name!r} is not simulated, or has no notebook")
        return self
