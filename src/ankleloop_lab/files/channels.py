"""Channels of a trial in a file: which of its variables they are, by name, with their times and sampling rates."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from ankleloop.errors import DataError
from ankleloop.options import as_text
from ankleloop.signals.sampling import check_same_rate, parse_rate
from ankleloop.trials.channels import TRUE_TORQUES
from ankleloop.trials.units import SCALES
from ankleloop_lab.files.contents import Contents, Variable
from ankleloop_lab.files.units import RATE_UNITS, is_time, split_time

TIME, RATE = "time", "sampling_rate"  # roles beside the channels of the trial
FOUND, NONE = "auto", "none"  # in place of the name of a variable
# Upper and lower case count: T is often the torque, not the time.
RATE_NAMES = ("sampling_rate", "sample_rate", "fs", "Fs")
MOSTLY = 0.9  # of the samples of times rise, also where they have gaps
# Names that say nothing of a channel that is a group or a struct.
PLAIN_NAMES = ("values", "value", "data", "samples", "signal")
# Words of a name that say what a channel is. A command of the position is a reference, one of the torque is nothing
# that a trial has.
CHANNEL_WORDS = {
    "position": ("position", "pos", "angle", "theta"),
    "torque": ("torque", "moment", "tq", "trq"),
    "reference": ("reference", "ref", "command", "cmd", "setpoint", "target"),
}
# Words that make another quantity of it.
OTHER_WORDS = {"velocity", "vel", "dot", "ddot", "speed", "acceleration", "accel", "acc", "rate"}
OTHER_WORDS |= {"offset", "gain", "index", "unit", "units", "name", "label"}


def find_names(contents: Contents, variables: Mapping[str, str | None]) -> dict[str, str]:
    """Names in the file by role: those that are stated, and of channels without one those that say the channel."""
    names: dict[str, str] = {}
    for role, stated in variables.items():
        taken = {name.lstrip("/") for name in (*variables.values(), *names.values()) if name}
        own = _list_own(contents, names["position"]) if "position" in names else contents.names()
        free = [name for name in own if name not in taken]
        # A link of HDF5 is not among the names.
        is_link = role not in (*contents.names(), *taken) and contents.find(role) is not None
        name = stated or (role if is_link else _find_channel(role, contents, free))
        if name is not None:
            names[role] = name
    return names


def _list_own(contents: Contents, position: str) -> list[str]:
    """Names of variables that may belong to a position: none beside another position."""
    position = position.lstrip("/")
    names = contents.names()
    if contents.find(position) is None:  # which is refused when it is read
        return names
    if "*" not in position:
        names = [variable.name for variable in contents.variables]
    positions = [name for name in names if channel_of(contents, name) == "position"]
    others = {contents.group_of(name) for name in positions} - {*contents.prefixes(position)}
    return [name for name in names if contents.group_of(name) not in others]


def _find_channel(channel: str, contents: Contents, names: Sequence[str]) -> str | None:
    """The only one of some names of variables that says a channel; None if none says that it is the reference.

    A name fits if one of its words, between underscores, spaces, brackets or capitals, is one of `CHANNEL_WORDS`:
    `ankle_angle` and `AnkleAngle` are positions, `angle_command` is a reference.
    """
    called = [name for name in names if channel_of(contents, name) == channel]
    fitting = _list_with_samples(contents, called)
    if len(fitting) == 1:
        return fitting[0]
    if channel == "reference" and not fitting:
        return None
    words = " or ".join(CHANNEL_WORDS[channel])
    fault = f"no variable is called {words} and has samples, so that it would be the {channel}"
    if fitting:
        fault = f"{len(fitting)} variables may be the {channel}: {contents.describe(fitting)}"
    others = _list_with_samples(contents, contents.names())
    parts = [each.name_channel() for each in map(contents.find, others) if each and each.is_matrix]
    part = f", or a part of one, as {parts[0]!r}" if parts else ""
    raise DataError(
        f"{contents.path.name}: {fault}; the file has: {contents.describe(others)}. Name one of these{part}.",
        remedy={channel: None},
    )


def _list_with_samples(contents: Contents, names: Iterable[str]) -> list[str]:
    """Names of variables that may be channels, no single numbers."""
    variables = {name: contents.find(name) for name in names}
    return [name for name, each in variables.items() if each and math.prod(each.shape) > 1]


def channel_of(contents: Contents, full_name: str) -> str | None:
    """Channel that a full name says; None if it says none, or something else."""
    *groups, last = contents.split_groups(full_name)
    if groups and last.lower() in PLAIN_NAMES:
        last = groups[-1]
    if last in TRUE_TORQUES:
        return None
    spaced = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", last).lower()
    words = re.findall(r"[^\W\d_]+", spaced)
    if OTHER_WORDS.intersection(words):
        return None
    channels = [
        channel for word in words for channel, names in CHANNEL_WORDS.items() if word in names
    ]
    if set(channels) == {"position", "reference"}:
        return "reference"
    if channels[-1:] == ["torque"] and set(channels) == {"position", "torque"}:
        return "torque"  # about the axis of the position, as `ankle_angle_r_moment` of OpenSim
    return channels[0] if len(set(channels)) == 1 else None


def find_channels(
    contents: Contents, variables: Mapping[str, str | None]
) -> Iterator[tuple[str, Variable, np.ndarray]]:
    """The variables of a trial by role, without samples, but the first one of a part, so that a neighbour is noticed.

    One that does not exist is refused when it is read.
    """
    for role, name in find_names(contents, variables).items():
        with suppress(DataError):
            variable = contents.require(name)
            samples = contents.read_numbers(variable) if "[" in variable.name else np.empty(0)
            yield role, _describe(contents, variable), samples.ravel()[:1]


def read_channels(
    contents: Contents,
    variables: Mapping[str, str | None],
    rate: float | None = None,
    time: str | None = FOUND,
) -> Iterator[tuple[str, Variable, np.ndarray]]:
    """Read the variables of a trial, its times and its sampling rate, each alone, from an open file.

    `variables` are names in the file by role, None where they are to be found; `rate` is what the caller states [Hz],
    `time` the name of the times, `FOUND`, or None to leave them out. The true torques of a simulation are read where
    the file has them beside the torque.
    """
    names = find_names(contents, variables)
    selected = {role: contents.require(name) for role, name in names.items()}
    _check_channels(contents, selected)
    group = contents.group_of(selected["torque"].name)
    for role in TRUE_TORQUES:
        variable = contents.find(f"{group}{role}")
        if variable is not None:
            selected[role] = variable
    for role, variable in selected.items():
        described = _describe(contents, variable)
        yield role, described, contents.read_numbers(described)
    position = selected["position"].name.lstrip("/")
    if time == FOUND:
        taken = [variable.name for variable in selected.values()]
        time = _find_times(contents, position, taken)
    if time not in (None, NONE):
        yield (TIME, *_read_times(contents, contents.require(time)))
    stated = _find_rate(contents, position, rate)
    if stated is not None:
        yield RATE, Variable(RATE, (), lambda: stated), np.array([stated])


def _check_channels(contents: Contents, channels: Mapping[str, Variable]) -> None:
    """Refuse a matrix, several trials, and a variable without samples, in place of a channel."""
    for role, variable in channels.items():
        if math.prod(variable.shape) == 0:
            raise DataError(
                f"{contents.path.name}: {variable.name} has no samples, so it is no {role}: leave this trial out, or "
                "name another variable."
            )
    parts = {
        role: variable.name_channel()
        for role, variable in channels.items()
        if variable.is_matrix or variable.count is not None
    }
    for role, part in parts.items():
        raise DataError(
            f"{contents.path.name}: {channels[role]} is no single channel: name one, counted "
            f"from 0, as {role}={part!r}. Where several recordings can be, a * in place of its number stands for all.",
            remedy=parts,
        )


def _describe(contents: Contents, variable: Variable) -> Variable:
    """A variable with its unit and its scale, where they stand beside it: in its struct, or as its name with a word."""
    prefix = contents.group_of(variable.name)
    is_plain = variable.name.removeprefix(prefix).lower() in PLAIN_NAMES
    start = prefix if is_plain else f"{variable.name}_"
    attributes = dict(variable.attributes)
    for word in ("unit", "units", *SCALES):
        part = contents.find(f"{start}{word}")
        values = np.empty(0) if part is None else np.ravel(part.read())
        if values.size == 1:
            attributes[word] = values[0]
    return replace(variable, attributes=attributes)


def _find_times(contents: Contents, position: str, taken: Sequence[str]) -> str | None:
    """Name of what may be the times, the nearest to the position; None if there is nothing.

    Of several as near the first counts that rises, and of these one that states a unit, before a counter of samples.
    """
    own = [name for name in _list_own(contents, position) if name not in taken]
    names = _list_with_samples(contents, own)
    for prefix in contents.prefixes(position):
        near = [name for name in names if contents.group_of(name) == prefix]
        variables = filter(None, map(contents.find, near))
        times = [
            (variable, split_time(variable.name)[1] or variable.unit)
            for variable in variables
            if is_time(variable.name.removeprefix(prefix)) or is_time(variable.unit)
        ]
        if len(times) > 1:
            times.sort(key=lambda time: (not _rises(contents, time[0]), not time[1]))
        if times:
            return times[0][0].name
    return None


def _rises(contents: Contents, variable: Variable) -> bool:
    """Whether samples rise from one to the next, but for a few."""
    try:
        values = _read_times(contents, variable)[1]
    except DataError:
        return False
    return float(np.mean(np.diff(values) > 0)) > MOSTLY


def _read_times(contents: Contents, variable: Variable) -> tuple[Variable, np.ndarray]:
    """Times as numbers; those of a clock in seconds."""
    values = np.ravel(variable.read())
    if ":" not in as_text(values[0]):
        return variable, contents.read_numbers(variable)
    import pandas as pd

    texts = [as_text(value).replace(",", ".") for value in values.tolist()]
    hours = "00:" if texts[0].count(":") == 1 else ""  # those that have minutes and seconds
    clock = pd.to_timedelta([hours + text for text in texts], errors="coerce")
    if clock.isna().all():
        dates = pd.to_datetime(texts, format="mixed", errors="coerce")
        clock = dates - dates[0]
    return replace(variable, attributes={"units": "s"}), clock.total_seconds().to_numpy()


def _find_rate(contents: Contents, position: str, given: float | None) -> float | None:
    """The sampling rate [Hz] that is given, or else nearest to the position in the file; all that count agree.

    Of several in the file the one counts that a given rate is nearest to.
    """
    source = contents.path.name
    rates: dict[str, float] = {}
    for prefix in contents.prefixes(position):
        found = [contents.find_number(prefix, name) for name in RATE_NAMES]
        numbers = [number for number in found if number is not None]
        if numbers:
            rates = _read_rates(numbers, given, source=source)
            break
    if given is not None and rates:
        nearest = min(rates, key=lambda name: abs(rates[name] - given))
        rates = {nearest: rates[nearest]}
    stated = given or next(iter(rates.values()), None)
    for name, rate in rates.items():
        check_same_rate(stated or rate, rate, source=source, name=name)
    return stated


def _read_rates(
    numbers: Sequence[Variable], given: float | None, *, source: str
) -> dict[str, float]:
    """Sampling rates [Hz] by name; what cannot be read contradicts no rate that is given."""
    rates = {}
    for number in numbers:
        try:
            rate = parse_rate(number.read(), source=f"{source}: {number.name}")
            if number.unit.lower() not in RATE_UNITS:
                raise DataError(f"{source}: {number.name} is in {number.unit}, not in Hz.")
            rates[number.name] = rate
        except DataError as error:
            if given is None:
                raise DataError(
                    f"{error} Pass sampling_rate in Hz.", remedy={"sampling_rate": None}
                ) from None
    return rates
