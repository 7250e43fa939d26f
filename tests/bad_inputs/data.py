"""Records that are valid as files, and cannot carry a conclusion."""

from collections.abc import Callable
from functools import partial

import numpy as np
import xarray as xr

from ankleloop import check_trial, identify, new_trial
from ankleloop.errors import DataError
from ankleloop.signals.decimation import lowpass
from bad_inputs.bad_input import BadInput, rows_of
from bad_inputs.inputs import simulated_trial

DURATION = 30.0  # s


def warnings_or_refusal(trial: xr.Dataset, method: str = "riv") -> list[str]:
    """Warnings of an estimate, or the reason why there is none: either tells the user."""
    try:
        return list(identify(trial, method).diagnostics["warnings"])
    except DataError as refusal:
        return [str(refusal)]


def reasons_of(trial: xr.Dataset) -> list[str]:
    """Reasons of the check of a recording."""
    return check_trial(trial).reasons


identified = partial(rows_of(warnings_or_refusal), error=None)
checked = partial(rows_of(reasons_of), error=None)


def record(change: Callable[[dict[str, np.ndarray]], object], **settings):
    """A simulated record whose channels a function has changed."""

    def make(folder) -> xr.Dataset:
        trial = simulated_trial(duration=DURATION, **settings)
        channels = {name: trial[name].values.copy() for name in ("position", "torque", "reference")}
        change(channels)
        return new_trial(**channels, sampling_rate=trial.attrs["sampling_rate"])

    return make


def signals(position=None, torque=None, seed: int = 0):
    """A record of signals that have nothing to do with a joint."""

    def make(folder) -> xr.Dataset:
        time, rng = np.arange(30_000) / 1000.0, np.random.default_rng(seed)
        return new_trial(position(time, rng), torque(time, rng), 1000.0, position(time, rng))

    return make


def _turn(name: str):
    return lambda channels: channels.update({name: -channels[name]})


def _swap(first: str, second: str):
    return lambda channels: channels.update({first: channels[second], second: channels[first]})


def _clip(name: str, share: float):
    def change(channels) -> None:
        limit = share * np.abs(channels[name]).max()
        channels[name] = channels[name].clip(-limit, limit)

    return change


def _stop(name: str, start: float):
    def change(channels) -> None:
        first = int(start * channels[name].size)
        channels[name][first:] = channels[name][first]

    return change


def _spike(name: str, size: float):
    def change(channels) -> None:
        channels[name][15_000] += size * channels[name].std()

    return change


def _shuffle(name: str):
    """A channel of another trial, as a wrong file gives it."""

    def change(channels) -> None:
        channels[name] = simulated_trial(duration=DURATION, seed=99)[name].values

    return change


def _filter_torque(channels) -> None:
    """The reference is the torque through the low-pass of an amplifier, in other units."""
    channels["reference"] = 0.005 * lowpass(channels["torque"], 50)


def _drift(channels) -> None:
    channels["torque"] += np.linspace(0.0, 20.0 * channels["torque"].std(), channels["torque"].size)


def _sine(frequency: float):
    return lambda time, rng: 0.02 * np.sin(2 * np.pi * frequency * time)


def _rows_of_faults() -> list[BadInput]:
    return [
        identified("torque of the wrong sign", record(_turn("torque")), "sign"),
        identified("position of the wrong sign", record(_turn("position")), "sign"),
        identified("clipped torque", record(_clip("torque", 0.3)), "range of the torque"),
        identified(
            "a torque that is dead in the second half", record(_stop("torque", 0.5)), "keep one value", "segment"
        ),
        identified("a spike in the torque", record(_spike("torque", 50.0)), "torque", "15000"),
        identified("the torque of another trial", record(_shuffle("torque")), "torque"),
        identified("the reference of another trial", record(_shuffle("reference")), "reference"),
        identified(
            "position and reference exchanged",
            record(_swap("position", "reference")),
            "the position is ahead of reference",
            "exchanged",
        ),
        identified(
            "a filter of the torque as reference",
            record(_filter_torque),
            "reference is a filter of the torque",
            "command of the servo",
        ),
        checked("a torque that drifts, checked", record(_drift), "drift"),
        checked("a sine in place of a perturbation, checked", signals(_sine(2.0), _sine(2.5)), "excit"),
        identified(
            "merged: the second trial has the wrong sign", _good_and_turned, "trial 2 of 2", "sign", call=_merged
        ),
    ]


def _good_and_turned(folder) -> list[xr.Dataset]:
    return [record(lambda channels: None)(folder), record(_turn("torque"))(folder)]


def _merged(trials) -> list[str]:
    return identify(trials, "pr-moesp")[0].diagnostics["warnings"]


ROWS: list[BadInput] = [
    BadInput(
        "position and torque swapped",
        lambda folder: None,
        lambda _: record(_swap("position", "torque"))(None),
        ("position moves at",),
    ),
    *_rows_of_faults(),
]
