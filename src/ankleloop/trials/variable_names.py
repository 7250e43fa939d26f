"""Channels of a trial by the names of the variables of a file, where the names leave no choice."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

from ankleloop.errors import DataError
from ankleloop.trials.channels import ANGLES, Channel, find_unit_in_name
from ankleloop.trials.trial import TRUE_TORQUES

# Words of a name that say what a channel is. A command of the position is a reference, one of the torque is nothing
# that a trial has.
WORDS = {
    "position": ("position", "pos", "angle", "theta"),
    "torque": ("torque", "moment", "tq", "trq"),
    "reference": ("reference", "ref", "command", "cmd", "setpoint", "target"),
}
# Words that make another quantity of it.
OTHERS = frozenset(
    ("velocity", "speed", "acceleration", "rate", "offset", "gain", "index", "unit", "units", "name", "label")
)
LISTED = 30  # names of variables that a message lists


class AmbiguousNameError(DataError):
    """A channel that the names of the variables leave open.

    Parameters
    ----------
    message : str
        What the names leave open.
    channel : str
        The channel, "position", "torque" or "reference".
    """

    def __init__(self, message: str, channel: str) -> None:
        super().__init__(message)
        self.channel = channel


def find_variable(channel: str, variables: Sequence[Channel], *, source: str, taken: Iterable[str] = ()) -> str | None:
    """Find the variable of a channel by its name.

    A name fits if one of its words, between underscores, spaces, brackets or capitals, is one of `WORDS`: `ankle_angle`
    and `AnkleAngle` are positions, `angle_command` is a reference.
    """
    excluded = set(taken)
    fitting = [v.name for v in variables if v.name not in excluded and _is_signal(v) and _channel_of(v.name) == channel]
    if len(fitting) == 1:
        return fitting[0]
    if fitting:
        text = f"{len(fitting)} variables may be the {channel}: {_list_names(fitting)}. Name one of them."
        raise AmbiguousNameError(f"{source}: {text}", channel)
    if channel == "reference":
        return None
    text = f"no variable is called {' or '.join(WORDS[channel])}, so that it would be the {channel}; the file has: "
    names = [variable.name for variable in variables if _is_signal(variable)]
    raise AmbiguousNameError(f"{source}: {text}{_list_names(names) or 'none'}. Name one of these.", channel)


def find_position_unit(variable: Channel) -> str | None:
    """Unit of a position as the file or the name of the variable states it."""
    return ANGLES.get(variable.unit.lower() or find_unit_in_name(variable.name, tuple(ANGLES)))


def _is_signal(variable: Channel) -> bool:
    """Whether a variable may have samples: it is no single number, and its shape may be unknown."""
    size = 1
    for length in variable.shape:
        size *= length
    return variable.shape == () or size > 1


def _channel_of(name: str) -> str | None:
    """Channel that a full name says; None if it says none, or something else."""
    last = re.split(r"[/.]", name.rstrip("/."))[-1]
    if last in TRUE_TORQUES:
        return None
    spaced = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", last).lower()
    words = set(re.findall(r"[^\W\d_]+", spaced))
    channels = [channel for channel, synonyms in WORDS.items() if words & set(synonyms)]
    if words & OTHERS or not channels:
        return None
    if channels == ["position", "reference"]:
        return "reference"
    return channels[0] if len(channels) == 1 else None


def _list_names(names: Sequence[str]) -> str:
    shown = [name if name.isprintable() else repr(name) for name in names[:LISTED]]
    return ", ".join(shown) + (" and more" if len(names) > LISTED else "")
