"""Records that are valid as files, and cannot carry a conclusion."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import xarray as xr

from ankleloop import METHODS, LongRecord, check_trial, identify, identify_file, new_trial, save_trial
from ankleloop.errors import DataError
from ankleloop.signals.decimation import lowpass
from bad_inputs.bad_input import BadInput, rows_of
from bad_inputs.inputs import simulated_trial

TITLE = "Records that cannot carry a conclusion"
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


identified = partial(rows_of(warnings_or_refusal), error=None, shown="identify")
checked = partial(rows_of(reasons_of), error=None, shown="check_trial")


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


def _scale(name: str, factor: float):
    return lambda channels: channels.update({name: factor * channels[name]})


def _shift(name: str, samples: int):
    return lambda channels: channels.update({name: np.roll(channels[name], samples)})


def _filter_torque(channels) -> None:
    """The reference is the torque through the low-pass of an amplifier, in other units."""
    channels["reference"] = 0.005 * lowpass(channels["torque"], 50)


def _drift(channels) -> None:
    channels["torque"] += np.linspace(0.0, 20.0 * channels["torque"].std(), channels["torque"].size)


def _sine(frequency: float):
    return lambda time, rng: 0.02 * np.sin(2 * np.pi * frequency * time)


def _noise(size: float):
    return lambda time, rng: size * rng.standard_normal(time.size)


def _faults() -> dict[str, tuple]:
    """Faults with what makes the record, what an identification must say, and what a check must say."""
    return {
        "torque of the wrong sign": (record(_turn("torque")), ("sign",), ("sign", "torque_sign: -1")),
        "position of the wrong sign": (record(_turn("position")), ("sign",), ("sign",)),
        "clipped torque": (record(_clip("torque", 0.3)), ("range of the torque",), ("range of the torque",)),
        "clipped position": (record(_clip("position", 0.5)), ("range of the position",), ("range of the position",)),
        "a torque that is dead in the second half": (
            record(_stop("torque", 0.5)),
            ("keep one value", "segment"),
            ("torque",),
        ),
        "a position that is dead in the second half": (
            record(_stop("position", 0.5)),
            ("reference explains 0.0 % of the position",),
            ("position",),
        ),
        "a spike in the torque": (record(_spike("torque", 50.0)), ("torque", "15000"), ("torque",)),
        "the torque of another trial": (record(_shuffle("torque")), ("torque",), ("coheren",)),
        "the reference of another trial": (record(_shuffle("reference")), ("reference",), ("reference",)),
        "position and reference exchanged": (
            record(_swap("position", "reference")),
            ("the position is ahead of reference", "exchanged"),
            ("the position is ahead of reference", "exchanged"),
        ),
        "a filter of the torque as reference": (
            record(_filter_torque),
            ("reference is a filter of the torque", "command of the servo"),
            ("reference is a filter of the torque",),
        ),
        "a torque that is a second late": (record(_shift("torque", 1000)), ("torque",), ("torque",)),
        "a torque that drifts": (record(_drift), ("torque",), ("drift",)),
        "a sine in place of a perturbation": (signals(_sine(2.0), _sine(2.5)), (), ("excit",)),
        "white noise on both channels": (signals(_noise(0.01), _noise(1.0)), (), ("coheren",)),
        "noise far above the torque": (record(lambda channels: None, snr_db=-30.0), (), ("reference",)),
    }


def stream(make):
    """The record in a file, for an identification piece by piece."""

    def save(folder: Path) -> Path:
        save_trial(make(folder), folder / "record.nc")
        return folder / "record.nc"

    return save


def warnings_of_record(path: Path) -> list[str]:
    """Warnings of an estimate of a long record."""
    with TemporaryDirectory() as folder:
        return list(identify_file(LongRecord(path), Path(folder, "torques.nc")).diagnostics["warnings"])


def _rows_of_other_calls() -> list[BadInput]:
    """The same faults in long records, in merged trials, and by the other methods."""
    streamed = partial(rows_of(warnings_of_record), error=None, shown="identify_file")
    turned, other = record(_turn("torque")), record(_shuffle("torque"))
    rows = [
        streamed("long record: torque of the wrong sign", stream(turned), "K = ", "is negative", "sign"),
        streamed("long record: the torque of another trial", stream(other), "explain", "of the torque"),
        streamed(
            "long record: a torque that is dead in the second half", stream(record(_stop("torque", 0.5))), "torque"
        ),
        streamed("long record: a spike in the torque", stream(record(_spike("torque", 50.0))), "15000"),
        identified(
            "merged: the second trial has the wrong sign", _good_and_turned, "trial 2 of 2", "sign", call=_merged
        ),
    ]
    for method in METHODS:
        call = partial(warnings_or_refusal, method=method)
        rows.append(identified(f"{method}: torque of the wrong sign", turned, "sign", call=call))
        rows.append(identified(f"{method}: the torque of another trial", other, "explain", "torque", call=call))
    return rows


def _good_and_turned(folder) -> list[xr.Dataset]:
    return [record(lambda channels: None)(folder), record(_turn("torque"))(folder)]


def _merged(trials) -> list[str]:
    return identify(trials, "pr-moesp")[0].diagnostics["warnings"]


def _repeated(*numbers: int, copied: bool = False):
    """A list of trials in which one may stand twice, as an object or as samples."""

    def make(folder) -> list[xr.Dataset]:
        trials = [simulated_trial(duration=DURATION, seed=number) for number in numbers]
        return [trial.copy(deep=True) for trial in trials] if copied else trials

    return make


def _rows_of_repeated_trials() -> list[BadInput]:
    merged = partial(rows_of(identify), shown="identify")
    words = "trials 1 and 3 of 3 are the same record", "count twice"
    return [
        merged("merged: a trial twice", _repeated(1, 2, 1), *words),
        merged("merged: a copy of a trial", _repeated(1, 2, 1, copied=True), *words),
        merged(
            "merged by eiv-moesp: a trial twice", _repeated(1, 2, 1), *words, call=partial(identify, method="eiv-moesp")
        ),
        merged("merged, checked: a trial twice", _repeated(1, 2, 1), *words, call=check_trial, shown="check_trial"),
    ]


ROWS: list[BadInput] = [
    BadInput(
        "position and torque swapped",
        lambda folder: None,
        lambda _: record(_swap("position", "torque"))(None),
        ("position moves at",),
        shown="new_trial",
    ),
]
for _wrong, (_make, _identified, _checked) in _faults().items():
    ROWS += [identified(_wrong, _make, *_identified), checked(f"{_wrong}, checked", _make, *_checked)]
ROWS += _rows_of_other_calls()
ROWS += _rows_of_repeated_trials()
