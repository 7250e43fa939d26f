"""Records that are valid as files, and cannot carry a conclusion."""

from collections.abc import Callable

import numpy as np
import xarray as xr

from ankleloop import check_trial, identify, new_trial
from ankleloop.errors import DataError
from ankleloop.signals.decimation import decimation_taps
from bad_inputs.bad_input import rows_of
from bad_inputs.inputs import changed, simulated_trial

DURATION = 30.0  # s
RATE = 1000.0


def lowpass(x, factor):
    """The low-pass of a decimation without the decimation."""
    return np.convolve(x - np.mean(x), decimation_taps(factor, 0)[0], "same")


def warnings_or_refusal(trial: xr.Dataset | list[xr.Dataset], method: str = "riv") -> list[str]:
    """Warnings of an estimate, or the reason why there is none: either tells the user."""
    try:
        return identify(trial, method).diagnostics["warnings"]
    except DataError as refusal:
        return [str(refusal)]


def warnings_of_merged(trials: list[xr.Dataset]) -> list[str]:
    """Warnings of the estimate of merged trials."""
    return identify(trials, "pr-moesp").diagnostics["warnings"]


def record(change: Callable[[dict[str, np.ndarray]], dict[str, np.ndarray]]):
    """A simulated record, some channels of which a function replaces."""

    def make(folder) -> xr.Dataset:
        channels = {name: simulated_trial(duration=DURATION)[name].values for name in NAMES}
        return new_trial(**channels | change(channels), sampling_rate=RATE)

    return make


NAMES = ("position", "torque", "reference")


def other(name: str) -> np.ndarray:
    """A channel of another trial, as a wrong file gives it."""
    return simulated_trial(duration=DURATION, seed=99)[name].values


def good_and_turned(folder) -> list[xr.Dataset]:
    """Two records, the second of which has the torque turned round."""
    return [record(lambda channels: {})(folder), TURNED(folder)]


def sines(folder) -> xr.Dataset:
    """A record of two sines."""
    time = np.arange(30_000) / RATE
    position, torque = (0.02 * np.sin(2 * np.pi * frequency * time) for frequency in (2.0, 2.5))
    return new_trial(position, torque, RATE, position)


def clip(signal: np.ndarray) -> np.ndarray:
    """A signal that is cut at a third of its range."""
    return signal.clip(*(0.3 * np.abs(signal).max() * np.array([-1, 1])))


def stop(signal: np.ndarray) -> np.ndarray:
    """A signal whose second half keeps one value."""
    half = signal.size // 2
    return np.where(np.arange(signal.size) < half, signal, signal[half])


def add_spike(signal: np.ndarray) -> np.ndarray:
    """A signal with a spike of fifty standard deviations."""
    return changed(signal, 15_000, signal[15_000] + 50.0 * signal.std())


def drift(signal: np.ndarray) -> np.ndarray:
    """A signal that drifts by twenty standard deviations."""
    return signal + np.linspace(0.0, 20.0 * signal.std(), signal.size)


TURNED = record(lambda x: {"torque": -x["torque"]})
EXCHANGED = record(lambda x: {"position": x["reference"], "reference": x["position"]})
# The reference is the torque through the low-pass of an amplifier, in other units.
FILTER = 0.005 * decimation_taps(50, 0)[0]
FILTERED = record(
    lambda x: {"reference": np.convolve(x["torque"] - np.mean(x["torque"]), FILTER, "same")}
)

identified = rows_of(warnings_or_refusal, error=None)
checked = rows_of(lambda trial: check_trial(trial).reasons, error=None)
made = rows_of(
    lambda folder: record(lambda x: {"position": x["torque"], "torque": x["position"]})(folder)
)

ROWS = [
    made("position and torque swapped", None, "position moves at", remedy={"position_unit": "deg"}),
    identified("torque of the wrong sign", TURNED, "sign"),
    identified(
        "position of the wrong sign", record(lambda x: {"position": -x["position"]}), "sign"
    ),
    identified(
        "clipped torque", record(lambda x: {"torque": clip(x["torque"])}), "range of the torque"
    ),
    identified(
        "a dead torque",
        record(lambda x: {"torque": stop(x["torque"])}),
        "keep one value",
        "segment",
    ),
    identified(
        "a spike in the torque",
        record(lambda x: {"torque": add_spike(x["torque"])}),
        "torque",
        "15000",
    ),
    identified(
        "the torque of another trial", record(lambda x: {"torque": other("torque")}), "torque"
    ),
    identified(
        "the reference of another trial",
        record(lambda x: {"reference": other("reference")}),
        "reference",
    ),
    identified(
        "position and reference exchanged",
        EXCHANGED,
        "the position is ahead of reference",
        "exchanged",
    ),
    identified(
        "a filter of the torque",
        FILTERED,
        "reference is a filter of the torque",
        "command of the servo",
    ),
    identified(
        "one of two turned round", good_and_turned, "trial 2 of 2", "sign", call=warnings_of_merged
    ),
    checked("a torque that drifts", record(lambda x: {"torque": drift(x["torque"])}), "drift"),
    checked("a sine in place of a perturbation", sines, "excit"),
]
