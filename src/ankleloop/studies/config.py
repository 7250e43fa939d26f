"""The configuration: every key with its type, unit, default and bounds, and errors that name the key."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self

from pydantic import (
    Field,
    StringConstraints,
    WithJsonSchema,
    model_validator,
)

from ankleloop.methods.registry import METHODS
from ankleloop.options import Options, option, show_value, suggest_name
from ankleloop.paper.sweep_quantities import SWEEP_QUANTITIES
from ankleloop.simulation.settings import SimulationSettings
from ankleloop.studies.method_settings import MethodSettings, union_of_methods
from ankleloop.studies.points import SETTINGS, Design, PointTable, ValueRange
from ankleloop.studies.recording_settings import Recording

MAX_NAME = 100  # characters: names are parts of the names of files, which have at most 255 bytes
RECORDING_NAME = r"^[A-Za-z0-9][A-Za-z0-9_.-]*$"
# Figures that each notebook draws beside its page and its table; what each needs is in `studies.run_config`.
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
    "time-varying": ("errors", "trajectories"),
    "design": ("design",),
    "sweep": ("sweep",),
    "recordings": ("group",),
}
SCORES = {
    None: ("vaf_net_measured", "vaf_net_true", "vaf_intrinsic_true", "vaf_reflex_true"),
    "measured": ("vaf_net_measured", "vaf_intrinsic_measured", "vaf_reflex_measured"),
}  # by `against`

Name = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]*$", max_length=MAX_NAME)]
RecordingName = Annotated[str, StringConstraints(pattern=RECORDING_NAME, max_length=MAX_NAME)]
Names = Annotated[list[str], Field(min_length=1)]


class SweepSettings(Options):
    """Pictures of a study whose points differ in settings of the simulation or options of methods."""

    quantities: Names | None = option(
        None,
        "scores (vaf_net_true), parameters (K), relative errors of parameters (K_error), and shares of trials "
        "(failures, warnings) that are shown, a row or a panel each; null for the VAF of net, intrinsic and reflex "
        "torque and the errors of K and G",
    )
    methods: Names | None = option(None, "methods that are shown; null for all")
    difference: Annotated[list[str], Field(min_length=2, max_length=2)] | None = option(
        None, "two methods whose difference (first minus second, trial by trial) is shown as well; null for none"
    )
    axes: Names | None = option(
        None,
        "varied settings or options over which the pictures are drawn: one gives lines, two give maps, more give a "
        "matrix of effects; null for all in the order of the points",
    )
    band: Literal["mean", "trials"] = option(
        "mean", "bands of lines: the 95 % confidence interval of the mean, or 80 % of the trials (quantiles 10 to 90 %)"
    )

    @model_validator(mode="after")
    def _check_quantities(self) -> Self:
        _check_list("quantities", self.quantities or (), "quantity", SWEEP_QUANTITIES)
        return self

    def check(self, varied: Collection[str], methods: Collection[str], against: Literal["measured"] | None) -> None:
        """Refuse pictures of what a study does not have."""
        if not varied:
            raise ValueError("no setting and no option differs between the points: give points more than one value")
        _check_list("methods", self.methods or (), "method", methods)
        _check_list("difference", self.difference or (), "method", methods)
        _check_list("axes", self.axes or (), "varied parameter", varied)
        for name in self.quantities or ():
            if name.startswith("vaf_") and name not in SCORES[against]:
                scores = ", ".join(SCORES[against])
                raise ValueError(
                    f"quantities: a study with against: {against or 'null'} has no {name}; it has {scores}"
                )


PARAMETER = {
    "anyOf": [
        {"enum": sorted({*SETTINGS, *(name for method in METHODS.values() for name in method.options.model_fields)})},
        {"pattern": r"^[A-Za-z0-9_-]+\.[a-z_]+$"},
    ]
}
Points = Annotated[
    Any,
    WithJsonSchema(
        {
            "anyOf": [
                Design.model_json_schema(),
                PointTable.model_json_schema(),
                {
                    "type": "object",
                    "propertyNames": PARAMETER,
                    "additionalProperties": {
                        "anyOf": [
                            {"type": "array", "minItems": 1, "uniqueItems": True},
                            ValueRange.model_json_schema(),
                        ]
                    },
                },
                {
                    "type": "array",
                    "minItems": 1,
                    "uniqueItems": True,
                    "items": {"type": "object", "propertyNames": PARAMETER},
                },
            ]
        }
    ),
]


class FigureSettings(Options):
    """The trial and the window that figures of torques show."""

    methods: Annotated[list[str], Field(min_length=1)] | None = option(
        None, "methods that are drawn, a column each; null draws all"
    )
    trial: int = option(0, "number of the trial, from 0", ge=0)
    start: float = option(10.0, "start of the window", unit="s", ge=0)
    length: float = option(5.0, "length of the window", unit="s", gt=0)


if TYPE_CHECKING:
    Methods = dict[str, MethodSettings]
    SimulationNotebook = str
else:
    Methods = dict[Name, union_of_methods()]
    SimulationNotebook = Literal[tuple(name for name in NOTEBOOKS if name != "recordings")]


class _StudySettings(Options):
    """Keys of every study."""

    kind: str = option(description="source of the trials")
    title: str = option("", "heading of the report; if it is empty, the name of the study")
    figure: FigureSettings = option(description="what figures of torques show", default_factory=FigureSettings)
    methods: Methods = option(
        description="methods with their options, by the name that tables and figures use", min_length=1
    )

    @model_validator(mode="after")
    def _check_methods(self) -> Self:
        """Refuse names and labels by which results could be taken for those of another method, and unknown ones."""
        _check_cases("methods", self.methods)
        for name, method in self.methods.items():
            if name in METHODS and name != method.method:
                raise ValueError(
                    f"methods: {name} is the name of another method than {method.method}: choose another name"
                )
        labels = Counter(method.label or name for name, method in self.methods.items())
        for label, count in labels.items():
            if count > 1:
                raise ValueError(f"methods: {count} methods have the label {label!r}; give each one of its own")
        _check_list("figure: methods", self.figure.methods or (), "method", self.methods)
        return self


class SimulationStudy(_StudySettings):
    """A study of simulated trials."""

    kind: Literal["simulation"] = option(description="source of the trials")
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
            "parameters of the study, which are settings of the simulation and options of methods by name "
            "(`METHOD.option` is that of one method): lists or ranges of values, all combinations of which are points; "
            "a random design; a table with a row for each point; or a list of points"
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
        "what a trial does that cannot be simulated, or that a method cannot identify: count as a result, which is a "
        "row of the parameters with the error as `failure` and no scores, or stop the job with its error",
    )
    precision: Literal["single", "double"] = option(
        "double",
        "floating-point precision of trials and estimated torques on disk; single takes half the space, and rounds far "
        "below a 16-bit converter",
    )
    keep: Literal["everything", "estimates", "scores"] = option(
        "everything",
        "what is left on disk: everything, estimates without trials, or tables of scores and parameters alone; without "
        "trials, simulation and identification share a job",
    )
    job_minutes: float = option(
        1.0,
        "length of a job that is aimed at; the number of trials that share a job follows from it and from the measured "
        "cost of a trial and of each method",
        unit="min",
        gt=0,
        le=1e4,
    )
    points_per_chunk: int | None = option(
        None,
        "points that share a job, in place of job_minutes; points of different record length or rate do not share a "
        "chunk",
        ge=1,
    )
    trials_per_chunk: int | None = option(None, "trials of one point that share a job, in place of job_minutes", ge=1)
    sweep: SweepSettings = option(description="what the notebook sweep shows", default_factory=SweepSettings)

    @property
    def has_table(self) -> bool:
        """Whether a table lists its points."""
        return isinstance(self.points, Mapping) and "table" in self.points

    @property
    def chunk_key(self) -> Literal["trials_per_chunk", "points_per_chunk", "job_minutes"]:
        """Key that decides on the size of chunks."""
        if self.trials_per_chunk is not None:
            return "trials_per_chunk"
        return "job_minutes" if self.points_per_chunk is None else "points_per_chunk"

    @model_validator(mode="after")
    def _check_study(self) -> Self:
        if self.figure.trial >= self.trials:
            raise ValueError(
                f"figure: trial: there is no trial {self.figure.trial}; those of {self.trials} trials are 0 to "
                f"{self.trials - 1}"
            )
        if self.trials_per_chunk is not None and (self.points_per_chunk or 1) > 1:
            raise ValueError(
                "a chunk is some points, or part of the trials of one point: set points_per_chunk: 1 to use "
                f"trials_per_chunk, got points_per_chunk: {self.points_per_chunk}"
            )
        return self


class RecordingsStudy(_StudySettings):
    """A study of recordings of a laboratory."""

    kind: Literal["recordings"] = option(description="source of the trials")
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
    def _check_study(self) -> Self:
        check_recording_names("files", self.files)
        return self


def check_recording_names(key: str, names: Collection[str]) -> None:
    """Refuse names of recordings whose results would have the same paths."""
    _check_cases(key, names)
    for name in names:
        if f"{name}.html" in names:
            raise ValueError(f"{key}: {name}.html is the page of the recording {name}: choose another name")


def _check_list(key: str, names: Sequence[str], kind: str, known: Collection[str]) -> None:
    """Refuse names in a list that are unknown, or stand twice."""
    for name, count in Counter(names).items():
        if name not in known:
            raise ValueError(
                f"{key}: there is no {kind} {show_value(name)}{suggest_name(name, known)}; there are {', '.join(known)}"
            )
        if count > 1:
            raise ValueError(f"{key}: {name!r} is listed twice")


def _check_cases(key: str, names: Iterable[str]) -> None:
    """Refuse names that are one to a file system that does not tell capitals from small letters."""
    first: dict[str, str] = {}
    for name in names:
        other = first.setdefault(name.lower(), name)
        if other != name:
            raise ValueError(f"{key}: {other!r} and {name!r} differ in capitals only, which some file systems ignore")


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
        _check_cases("studies", self.studies)
        if "economy" in self.studies:
            raise ValueError("studies: 'economy' has another table, results/tables/economy.csv: give it another name")
        for name in self.studies:
            if f"{name}-trials" in self.studies:
                raise ValueError(f"studies: {name}-trials is the table of all trials of {name}: choose another name")
        if self.run is not None and not self.run:
            raise ValueError("run: names no study; there are " + ", ".join(self.studies))
        _check_list("run", self.run or (), "study", self.studies)
        _check_list("article", self.article, "study", self.studies)
        for name in self.article_names:
            study = self.studies[name]
            if not isinstance(study, SimulationStudy) or study.notebook is None:
                raise ValueError(f"article: the study {name!r} is not simulated, or has no notebook")
        if self.article_names:
            self._check_economy(self.studies.get("table1") if "table1" in self.article else None)
        return self

    @staticmethod
    def _check_economy(study: StudySettings | None) -> None:
        """Refuse an article for which the economy of the methods cannot be measured."""
        if not isinstance(study, SimulationStudy):
            raise ValueError(
                "article: needs the study 'table1', on whose trials the economy of the methods is measured; name it, "
                "or set article: [] to make none"
            )
        if study.keep != "everything":
            raise ValueError(
                "article: the study 'table1' must have keep: everything: the economy of the methods is measured on its "
                "trials"
            )
        for name in ("pr-moesp", "eiv-moesp"):
            if name in study.methods and study.methods[name].select:
                raise ValueError(f"article: {name} of the study 'table1' must not have select: its economy is measured")
