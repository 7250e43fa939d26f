"""Options that map the variables of a file to the channels of a trial."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, Self, TypeVar

from pydantic import Field, ValidationInfo, field_validator, model_validator

from ankleloop.errors import DataError
from ankleloop.options import Options, option, show_value
from ankleloop.trials.channels import CHANNELS
from ankleloop_lab.files.channels import FOUND, NONE, RATE, TIME
from ankleloop_lab.files.contents import Variable, number_trial
from ankleloop_lab.files.reading_process import read_channels
from ankleloop_lab.files.units import OPTIONS, ChannelUnit, find_unit, parse_option

# Names of further variables: not those that a trial has anyway, or that its reading records.
FURTHER_NAME = r"(?!torque|(position(_unit|_sign)?|reference|time|sampling_rate|source)$)[A-Za-z]\w*(?<!_variable)"
PAIRS = (
    "pairs of a name in the trial, of letters, digits and underscores, that no trial has anyway, and the variable of "
    "the file, as {'ankle_angle': 'angle'} or 'ankle_angle=angle'"
)


Factor = Annotated[float, Field(gt=0.0, le=1e9)]  # how much 1 is in the file
Reading = TypeVar("Reading", bound="ReadingOptions")


class ReadingOptions(Options):
    """How the variables of a file become the channels of a trial: their names, units and signs."""

    position: str | None = option(
        None, "name of the position variable in the file; null: found by its name", min_length=1
    )
    torque: str | None = option(
        None, "name of the torque variable in the file; null: found by its name", min_length=1
    )
    reference: str | None = option(
        None,
        "name of the command of the servo in the file, or none to take no variable for it; null: found by its name, "
        "where one has such a name",
        min_length=1,
    )
    time: str | None = option(
        FOUND,
        "name of the times in the file, or none to take no times; auto: found by name or unit",
        min_length=1,
    )
    sampling_rate: float | None = option(
        None, "sampling rate; null: that of the file", unit="Hz", ge=0.001, le=1e9
    )
    jitter: bool = option(
        False, "take an even clock behind times that jitter by more than half a sample"
    )
    resample: float | None = option(
        None,
        "rate at which samples that were taken unevenly are interpolated; null: times are those of an even clock",
        unit="Hz",
        ge=0.001,
        le=1e9,
    )
    position_unit: str | Factor | None = option(
        None,
        "unit of the position in the file, or the rad of 1 there; null: as the file states it, else rad",
    )
    torque_unit: str | Factor | None = option(
        None,
        "unit of the torque in the file, as ft.lb or Nm, or the N·m of 1 there; null: as the file states it, else N·m",
    )
    reference_unit: str | Factor | None = option(
        None,
        "unit of the reference in the file, or the rad of 1 there; null: as the file states it, else as the position",
    )
    position_sign: Literal[1, -1] = option(1, "-1 turns position and reference round")
    torque_sign: Literal[1, -1] = option(
        1, "-1 turns the torque round, so that it opposes stretch (positive K, B, I)"
    )
    case: int | None = option(
        None, "trial of an FLB file, from 1; null where it has one", ge=1, le=1_000_000
    )
    variables: dict[str, str] | str | None = option(
        None,
        "further variables of the trial, as a schedule or the phase of a cycle: name in the trial and variable of the "
        "file, as {ankle_angle: angle}; in tables ankle_angle=angle, with commas between several",
    )

    apparatus: str | None = option(
        None,
        "file with the estimate of the device without a subject, by the method apparatus, which is subtracted",
        min_length=1,
    )

    @field_validator("position_unit", "torque_unit", "reference_unit", mode="before")
    @classmethod
    def _as_unit(cls, value: Any, info: ValidationInfo) -> Any:
        """Units have several spellings."""
        return parse_option(str(info.field_name), value)

    @field_validator("variables", mode="before")
    @classmethod
    def _as_pairs(cls, value: Any) -> Any:
        """Tables and the command line have pairs as a text."""
        if value is None:
            return None
        pairs = value
        if isinstance(value, str):
            # Not at a comma in brackets, as of data[:, 2].
            parts = [pair.partition("=") for pair in re.split(r",(?![^\[]*\])", value)]
            pairs = {name.strip(): variable.strip() for name, _, variable in parts}
        is_valid = isinstance(pairs, Mapping) and all(
            isinstance(variable, str)
            and variable
            and re.fullmatch(FURTHER_NAME, str(name), re.ASCII)
            for name, variable in pairs.items()
        )
        if not is_valid:
            raise ValueError(f"variables must be {PAIRS}; got {show_value(value)}.")
        return dict(pairs)

    @model_validator(mode="after")
    def _check_times(self) -> Self:
        """Samples are interpolated over their times alone."""
        if self.resample is not None and (self.jitter or self.time == NONE or self.sampling_rate):
            raise ValueError(
                "resample excludes jitter, sampling_rate and time=none: it takes the times as they are."
            )
        return self

    @model_validator(mode="after")
    def _check_variables(self) -> Self:
        """A variable that serves as two channels makes every estimate of one by the other perfect, and wrong."""
        channels: dict[str, str] = {}
        for channel, name in self.channels.items():
            other = channels.setdefault(name.replace(" ", "").strip("/"), channel)
            if other != channel:
                raise ValueError(
                    f"{other} and {channel} are the same variable, {name!r}: name another one."
                )
        return self

    @property
    def names(self) -> dict[str, str | None]:
        """Names of all variables in the file by their names in the trial; None where they are to be found."""
        channels = {channel: getattr(self, channel) for channel in CHANNELS}
        if self.reference == NONE:
            del channels["reference"]
        return {**channels, **self.further}

    @property
    def channels(self) -> dict[str, str]:
        """Names of the variables in the file by channel, where they are stated."""
        return {role: name for role, name in self.names.items() if name and role in CHANNELS}

    @property
    def further(self) -> dict[str, str]:
        """Names of further variables in the file by their names in the trial."""
        return dict(self.variables) if isinstance(self.variables, dict) else {}

    def find_units(
        self, variables: Mapping[str, Variable], *, source: str
    ) -> dict[str, ChannelUnit]:
        """Units of the channels in the file; a reference of which nobody says one has that of the position."""
        units: dict[str, ChannelUnit] = {}
        for role, variable in variables.items():
            if role in (TIME, RATE, *self.further):
                continue
            option = OPTIONS.get(role, OPTIONS["torque"])[0]  # true torques have that of the torque
            units[role] = find_unit(
                role,
                variable.name,
                variable.unit,
                getattr(self, option),
                default=units.get("position") if role == "reference" else None,
                source=source,
            )
        return units

    def of_trial(self, number: int) -> Self:
        """Options of one trial, where names have a * for all of a file."""
        names = {role: number_trial(name, number) for role, name in self.channels.items()}
        further = {role: number_trial(name, number) for role, name in self.further.items()}
        return self.model_copy(update={**names, "variables": further or None})


def list_trials(path: Path, options: Reading) -> list[Reading]:
    """Options for each trial of a file, where the names of variables have a * in place of its number."""
    if "*" not in "".join(options.channels.values()):
        return [options]
    variables = read_channels(path, options.case, "find", variables=options.names)
    counts = {variables[role].count or 1 for role in options.channels if role in variables}
    if len(counts) > 1:
        raise DataError(f"{path.name}: the channels have different numbers of trials: {counts}.")
    return [options.of_trial(number) for number in range(max(counts, default=1))]
