"""The configuration: every key with its type, unit, default and bounds.

``python -m ankleloop_workflow.config.settings`` writes its JSON schema, in the root of the repository.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self, Union

from pydantic import (
    BeforeValidator,
    Field,
    GetJsonSchemaHandler,
    StringConstraints,
    ValidationError,
    WithJsonSchema,
    WrapValidator,
    model_validator,
)
from pydantic_core import InitErrorDetails, core_schema

from ankleloop.methods.registry import RECORD_METHODS, find_method
from ankleloop.options import Options, option, suggest_name
from ankleloop.quantities import TRIAL_QUANTITIES
from ankleloop.simulation.settings import (
    LOAD,
    LOAD_SETTINGS,
    SimulationSettings,
    expand_load,
)
from ankleloop_lab.checking import Values, check
from ankleloop_lab.recordings.method_settings import MethodSettings, settings_of
from ankleloop_lab.recordings.settings import MAX_NAME, RECORDING_NAME, Recording
from ankleloop_workflow.config.files import check_cases

SCHEMA = Path("workflow/schemas/config.schema.json")


Name = Annotated[
    str, StringConstraints(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]*$", max_length=MAX_NAME)
]
RecordingName = Annotated[str, StringConstraints(pattern=RECORDING_NAME, max_length=MAX_NAME)]
Names = Annotated[list[str], Field(min_length=1)]


def _union_of_methods() -> Any:
    """One model of `MethodSettings` for each set of options; the name of the method tells them apart."""
    names: dict[type[Options], list[str]] = {}
    for name, entry in RECORD_METHODS.items():
        names.setdefault(entry.options, []).append(name)
    models = tuple(settings_of(options, *members) for options, members in names.items())
    return Annotated[
        Union[models],  # noqa: UP007 # of a list
        Field(discriminator="method"),
        WrapValidator(_check_method),
        _OrOther(),
    ]


class _OrOther:
    """Lets the JSON schema have methods that other packages register, and null for one that is left out."""

    def __get_pydantic_json_schema__(
        self, schema: core_schema.CoreSchema, handler: GetJsonSchemaHandler
    ) -> Values:
        registered = {
            "description": "A method that another package registers: it is looked up when the configuration is read.",
            "type": "object",
            "properties": {"method": {"type": "string", "not": {"enum": list(RECORD_METHODS)}}},
            "required": ["method"],
        }
        left_out = {
            "description": "Leaves out a method that a file before this one has.",
            "type": "null",
        }
        return {"anyOf": [handler(schema), registered, left_out]}


def _check_method(value: Any, check_built_in: Callable[[Any], Any]) -> Any:
    """Settings of a method, of the library or registered by another package."""
    name = value.get("method") if isinstance(value, Mapping) else None
    if not isinstance(name, str) or name in RECORD_METHODS:
        return check_built_in(value)
    try:
        entry = find_method(name)
    except ValueError as error:
        fault: InitErrorDetails = {
            "type": "value_error",
            "loc": ("method",),
            "input": name,
            "ctx": {"error": error},
        }
        raise ValidationError.from_exception_data("method", [fault]) from None
    return check(settings_of(entry.options, name), value)


if TYPE_CHECKING:
    Methods = dict[str, MethodSettings]
else:
    Methods = dict[Name, _union_of_methods()]
# They are checked by `config.points`, whose messages name the point.
Points = Annotated[Any, WithJsonSchema({"type": ["object", "array"]})]


class SweepSettings(Options):
    """Pictures of a study whose points differ in settings of the simulation or options of methods."""

    quantities: Names | None = option(
        None,
        "scores (vaf_net_true), parameters (K), errors (K_error), shares of trials (failures); null for a choice",
    )
    methods: Names | None = option(None, "methods that are shown; null for all")
    difference: Annotated[list[str], Field(min_length=2, max_length=2)] | None = option(
        None,
        "two methods whose difference (first minus second, trial by trial) is shown as well; null for none",
    )
    axes: Names | None = option(
        None,
        "varied parameters: one gives lines, two give maps, more a matrix of effects; null for all in their order",
    )

    def check(self, varied: Collection[str], methods: Collection[str]) -> None:
        """Refuse pictures of what a study does not have."""
        if not varied:
            raise ValueError(
                "no setting and no option differs between the points: give points more than one value"
            )
        _check_list("quantities", self.quantities, "quantity", TRIAL_QUANTITIES)
        _check_list("methods", self.methods, "method", methods)
        _check_list("difference", self.difference, "method", methods)
        _check_list("axes", self.axes, "varied parameter", varied)


class FigureSettings(Options):
    """The trial and the window that figures of torques show."""

    methods: Names | None = option(None, "methods that are drawn, a column each; null draws all")
    trial: int = option(0, "number of the trial, from 0", ge=0)
    start: float = option(10.0, "start of the window", unit="s", ge=0)
    length: float = option(5.0, "length of the window", unit="s", gt=0)


class _StudySettings(Options):
    """Keys of every study."""

    kind: str = option(description="source of the trials")
    title: str = option("", "heading of the report; if it is empty, the name of the study")
    figure: FigureSettings = option(
        description="what figures of torques show", default_factory=FigureSettings
    )
    methods: Methods = option(
        description="methods by the names that tables and figures use", min_length=1
    )

    @model_validator(mode="before")
    @classmethod
    def _leave_out_methods(cls, values: Any) -> Any:
        """Without methods that are null, by which a file leaves out those of a file before it."""
        methods = values.get("methods") if isinstance(values, Mapping) else None
        if not isinstance(methods, Mapping):
            return values
        kept = {name: method for name, method in methods.items() if method is not None}
        return {**values, "methods": kept}

    @model_validator(mode="after")
    def _check_methods(self) -> Self:
        """Refuse names and labels by which results could be taken for those of another method, and unknown ones."""
        check_cases("methods", self.methods)
        for name, method in self.methods.items():
            if name in RECORD_METHODS and name != method.method:
                raise ValueError(
                    f"methods: {name} is the name of another method: choose another name"
                )
        labels = Counter(method.label or name for name, method in self.methods.items())
        for label, count in labels.items():
            if label.startswith("_"):
                raise ValueError(
                    f"methods: legends leave out labels with a low line in front, got {label!r}"
                )
            if count > 1:
                raise ValueError(
                    f"methods: {count} methods have the label {label!r}; give each one of its own"
                )
        _check_list("figure: methods", self.figure.methods, "method", self.methods)
        return self


def _expand_load(values: Any) -> Any:
    return expand_load(values) if isinstance(values, Mapping) else values


class _OrLoad:
    """Lets the JSON schema have the three parameters of the load together."""

    def __get_pydantic_json_schema__(
        self, schema: core_schema.CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        described = handler.resolve_ref_schema(handler(schema))
        described["properties"][LOAD] = {
            "description": "inertia, viscosity and stiffness of the load, instead of the three settings",
            "type": "array",
            "items": {"type": "number"},
            "minItems": len(LOAD_SETTINGS),
            "maxItems": len(LOAD_SETTINGS),
        }
        return described


class SimulationStudy(_StudySettings):
    """A study of simulated trials."""

    kind: Literal["simulation"] = option(description="source of the trials")
    notebook: Name | None = option("table1", "notebook that renders the study; null for none")
    trials: int = option(20, "simulated trials at each point", ge=1, le=100000)
    seed: int = option(
        description="seed of the study, from which every trial has a stream of its own", ge=0
    )
    simulation: Annotated[SimulationSettings, BeforeValidator(_expand_load), _OrLoad()] = option(
        description="settings of every trial", default_factory=SimulationSettings
    )
    points: Points = option(
        description="settings and options that vary, by name (`METHOD.option` is that of one method): lists or ranges "
        "of values, whose combinations are points; a random design; a table, or a list, of points",
        default_factory=lambda: [{}],
    )
    against: Literal["measured"] | None = option(
        None,
        "what estimates are scored against; null for the true torques, measured as if these were unknown",
    )
    precision: Literal["single", "double"] = option(
        "double",
        "floating-point precision of trials and estimated torques on disk; single takes half the space",
    )
    keep: Literal["everything", "estimates", "scores"] = option(
        "everything",
        "what is left on disk: everything, estimates without trials, or scores and parameters alone",
    )
    trials_per_chunk: int = option(
        200,
        "trials that share a job: whole points until it has as many; a point of more is divided",
        ge=1,
    )
    sweep: SweepSettings = option(
        description="what the notebook sweep shows", default_factory=SweepSettings
    )

    @model_validator(mode="after")
    def _check_study(self) -> Self:
        if self.figure.trial >= self.trials:
            raise ValueError(
                f"figure: trial: there is no trial {self.figure.trial}; the last one is {self.trials - 1}"
            )
        return self


class RecordingsStudy(_StudySettings):
    """A study of recordings of a laboratory."""

    kind: Literal["recordings"] = option(description="source of the trials")
    notebook: Name | None = option("recordings", "notebook that renders the study; null for none")
    folder: str = option(".", "folder of the files; ${NAME} stands for an environment variable")
    files: dict[RecordingName, Recording] = option(
        description="recordings by name; the name appears in the paths of the results",
        default_factory=dict,
    )
    shared: Values = option(
        description="values for recordings that do not give their own",
        alias="defaults",
        default_factory=dict,
    )
    table: str | None = option(
        None,
        "CSV file with a row for each recording, and its keys and an optional name as columns; null for none",
    )
    recordings_per_chunk: int = option(8, "recordings that share a job", ge=1)

    @model_validator(mode="before")
    @classmethod
    def _apply_defaults(cls, values: Any) -> Any:
        defaults, files = (values.get(name) or {} for name in ("defaults", "files"))
        if not isinstance(defaults, Mapping) or not isinstance(files, Mapping):
            return values
        complete = {
            name: {**defaults, **file} if isinstance(file, Mapping) else file
            for name, file in files.items()
        }
        return {**values, "files": complete}


def _check_list(key: str, names: Sequence[str] | None, kind: str, known: Collection[str]) -> None:
    """Refuse names in a list that are unknown, or stand twice."""
    for name, count in Counter(names or ()).items():
        if name not in known:
            raise ValueError(
                f"{key}: there is no {kind} {name!r}{suggest_name(name, known)}; there are {', '.join(known)}"
            )
        if count > 1:
            raise ValueError(f"{key}: {name!r} is listed twice")


class Config(Options):
    """The whole configuration."""

    run: Names | None = option(None, "names of the studies to make; null for all of them")
    article: list[str] = option(
        description="studies of the ledger and the article, made where all of these are run",
        default_factory=list,
    )
    studies: dict[
        Name, Annotated[SimulationStudy | RecordingsStudy, Field(discriminator="kind")]
    ] = option(
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
        check_cases("studies", self.studies)
        if "economy" in self.studies:
            raise ValueError(
                "studies: 'economy' has another table, results/tables/economy.csv: give it another name"
            )
        for name in self.studies:
            if f"{name}-trials" in self.studies:
                raise ValueError(
                    f"studies: '{name}-trials' has the table of all trials of {name!r}: give it another name"
                )
        _check_list("run", self.run, "study", self.studies)
        _check_list("article", self.article, "study", self.studies)
        if self.article_names:
            studies = {name: self.studies[name] for name in self.article}
            if not all(study.kind == "simulation" and study.notebook for study in studies.values()):
                raise ValueError("article: its studies are simulated and have a notebook")
            table1 = studies.get("table1")
            if not isinstance(table1, SimulationStudy) or table1.keep != "everything":
                raise ValueError(
                    "article: the economy of the methods is measured on the trials of the study 'table1': "
                    "name it and set its keep: everything, or set article: [] to make none"
                )
        return self


def schema_text() -> str:
    """The JSON schema of the configuration: every key with its description, unit, default and bounds."""
    schema = json.loads(json.dumps(Config.model_json_schema()), object_hook=_tidy)
    header = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "ankleloop configuration",
    }
    return json.dumps({**header, **schema}, indent=2, ensure_ascii=False) + "\n"


def _tidy(schema: Values) -> Values:
    """A part of the schema without a title that repeats its key, and with the first sentence of its docstring."""
    if isinstance(schema.get("title"), str):
        del schema["title"]
    if schema.get("type") == "object" and "description" in schema:
        schema["description"] = schema["description"].partition("\n\n")[0].replace("\n", " ")
    return schema


if __name__ == "__main__":
    SCHEMA.write_text(schema_text(), encoding="utf-8")
