"""A perturbation for a joint and its load: steps after random times, whose weights are optimised."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
import pandas as pd
import xarray as xr
from scipy.io import savemat

from ankleloop.errors import DataError
from ankleloop.joint.estimate import Estimate
from ankleloop.options import check_flag, check_integer, check_number, check_path
from ankleloop.simulation.settings import DWELL_TIMES
from ankleloop.trials.files import atomic_file
from ankleloop.trials.units import POSITION_UNITS
from ankleloop_lab.experiments.experiment import (
    LONGEST_RECORD,
    LOST_TIME,
    Experiment,
    describe_joint,
    largest_magnitude,
    mean_speed,
)

COMPARED_PARAMETERS = ("K", "B", "G")
PRBS = {"perturbation": "prbs", "switching_interval": 0.1}
COMPARED_DURATION = 24.0  # s, of the sequences by which perturbations are compared
COARSE_STEPS = 5  # of the integration in a recorded sample: 0.01 % of the variances
# Of the evolution strategy: generations, children and parents of each, sequences by which a child is judged.
GENERATIONS = 25
CHILDREN = 8
PARENTS = 4
SEQUENCES = 2
SUM_SHARE = 0.05  # of the sum of the time ratios in the criterion, beside the largest of them
LEAST_AMPLITUDE = 0.1  # of that which was asked for


@dataclass(frozen=True, eq=False)
class PerturbationDesign:
    """A random perturbation for a joint: steps between two positions, after dwell times that have weights.

    Parameters
    ----------
    weights : dict
        Share of each dwell time [s] among the dwells.
    amplitude : float
        Half of the steps [rad], the mean over sequences: each of them is within the limits by itself.
    time_ratio : dict
        Time for the same standard error of "K", "B" and "G" over that with a PRBS of 100 ms within the same limits.
    standard_errors : dict
        Standard error of every parameter that is expected from one record.
    seconds : float
        Length of the sequences [s].
    """

    weights: dict[float, float]
    amplitude: float
    time_ratio: dict[str, float]
    standard_errors: dict[str, float]
    seconds: float
    experiment: Experiment = field(repr=False)

    def draw(
        self, seed: int, seconds: float | None = None, unit: Literal["rad", "deg"] = "rad"
    ) -> xr.DataArray:
        """A new sequence: one that a subject meets again can be learnt, so take another seed for each trial.

        Parameters
        ----------
        seed : int
            Seed of the sequence.
        seconds : float, optional
            Its length [s], as that of a plan (see `plan_duration`); otherwise that of the design.
        unit : {"rad", "deg"}
            Unit of the command.

        Returns
        -------
        xarray.DataArray
            Command over time [s], within the limits of the design.
        """
        seed = check_integer("draw", "seed", seed, ge=0)
        duration = self.seconds if seconds is None else _check_seconds("draw", seconds)
        experiment = self.experiment.change(duration=duration)
        (command,) = experiment.draw(_dwells(self.weights.values()), seed, count=1)
        rate = experiment.settings.recording_rate
        time = xr.Variable("time", np.arange(command.size) / rate, {"units": "s"})
        attributes = {"units": unit, "long_name": "command of the servo", "seed": seed}
        command = command / _check_unit("draw", unit)
        return xr.DataArray(command, {"time": time}, name="command", attrs=attributes)

    def save(
        self,
        path: str | os.PathLike[str],
        *,
        seed: int,
        seconds: float | None = None,
        unit: Literal["rad", "deg"] = "rad",
        overwrite: bool = False,
    ) -> None:
        """Write a new sequence for the computer that commands the servo.

        Parameters
        ----------
        path : str or os.PathLike
            A .csv file with the columns "time_s" and "command_rad" (or "command_deg"), or a .mat file with the
            variables "time", "command", its unit "command_unit" and the rate "fs".
        seed : int
            Seed of the sequence.
        seconds : float, optional
            Its length [s]; otherwise that of the design.
        unit : {"rad", "deg"}
            Unit of the command.
        overwrite : bool
            Replace a file that exists.

        Raises
        ------
        DataError
            For another suffix, or a file that exists or cannot be written.
        """
        target = check_path("save", "path", path)
        if target.suffix not in (".csv", ".mat"):
            raise DataError(
                f"{target}: a command is written as .csv or .mat: choose one of these suffixes."
            )
        command = self.draw(seed, seconds, unit)
        time = command["time"].values
        rate = self.experiment.settings.recording_rate
        with atomic_file(target, overwrite=overwrite) as partial:
            if target.suffix == ".csv":
                columns = {"time_s": time, f"command_{unit}": command.values}
                pd.DataFrame(columns).to_csv(partial, index=False)
            else:
                variables = {
                    "time": time,
                    "command": command.values,
                    "command_unit": unit,
                    "fs": rate,
                }
                savemat(partial, variables, appendmat=False, oned_as="column")


def _check_unit(function: str, unit: str) -> float:
    """How many rad a unit of a command is."""
    if unit not in POSITION_UNITS:
        known = " or ".join(map(repr, POSITION_UNITS))
        raise ValueError(f"{function}: unit must be {known}; got {unit!r}.")
    return POSITION_UNITS[unit]


def design_perturbation(
    joint: Estimate | Mapping[str, Any],
    seconds: float = 24.0,
    amplitude: float = 0.02,
    gentle: bool = False,
    seed: int = 1,
    *,
    torque: float | None = None,
    servo_velocity: float | None = None,
    progress: Callable[[range], Iterable[int]] | None = None,
    **settings: Any,
) -> PerturbationDesign:
    r"""Design a random perturbation that tells more of K, B and G in the same time.

    The command is +A and −A in turn, each for a random time out of eleven from 20 to 600 ms. Their weights w are
    searched by an evolution strategy, for

    .. math:: \min_w \max_{\theta \in \{K, B, G\}} \frac{\mathrm{var}(\hat\theta; w)}{\mathrm{var}(\hat\theta;
              \mathrm{PRBS})}

    (plus 5 % of the sum of these ratios), the ratio of the times for the same standard error. The variances are
    those of `riv`, from the information that `ankleloop.cramer_rao` counts without the fed-back torque, at the same
    voluntary torque and noise [N·m] for every perturbation. A limit lowers the amplitude of every sequence that
    exceeds it, of the PRBS as well. Limits are those of the torque and the movement that the perturbation alone causes.

    Parameters
    ----------
    joint : Estimate or mapping
        The joint: an estimate of a pilot by `riv`, which also tells the spectrum of the disturbance; or settings of
        `simulate` by name, with `voluntary` and `snr_db` relative to the torque of a PRBS of 100 ms, or to
        `torque_level`.
    seconds : float
        Length of the sequences [s].
    amplitude : float
        Largest deviation of the command [rad].
    gentle : bool
        Limit the mean speed of the joint to that which the PRBS causes.
    seed : int
        Seed of the search.
    torque : float, optional
        Largest torque [N·m].
    servo_velocity : float, optional
        Largest velocity of the servo [rad/s].
    progress : callable, optional
        Wraps the range of the generations of the search, as tqdm does.
    **settings
        Further settings of `simulate`; with an estimate, load, servo and recorder, which it does not hold.

    Returns
    -------
    PerturbationDesign

    Raises
    ------
    UnstableLoopError
        If the joint is unstable with its load.
    DataError
        If the estimate has no spectrum of the noise, or the record would not tell the parameters apart.
    TypeError, ValueError
        For settings that `simulate` refuses, and for limits that leave less than a tenth of the amplitude.

    See Also
    --------
    ankleloop.plan_duration : How long to record, from the same pilot.

    Examples
    --------
    >>> design = design_perturbation({"load": (0.1, 10.0, 100.0), "voluntary": 0.3}, seconds=20.0)
    >>> max(design.time_ratio.values()) < 0.85
    True
    >>> command = design.draw(seed=2)
    >>> command.sizes["time"], command.attrs["units"]
    (20000, 'rad')
    """
    owner = "design_perturbation"
    seconds = _check_seconds(owner, seconds)
    amplitude = check_number(owner, "amplitude", amplitude, "rad", ge=1e-9, le=500)
    seed = check_integer(owner, "seed", seed, ge=0)
    limits = {}
    if torque is not None:
        limits["torque"] = check_number(owner, "torque", torque, "N·m", gt=0)
    if servo_velocity is not None:
        limits["servo_velocity"] = check_number(
            owner, "servo_velocity", servo_velocity, "rad/s", gt=0
        )
    others = {**settings, **PRBS, "amplitude": 2 * amplitude, "duration": COMPARED_DURATION}
    chosen = describe_joint(owner, joint, others)
    coarse = min(chosen.integration_rate, COARSE_STEPS * chosen.recording_rate)
    experiment = Experiment.of(
        joint, chosen.model_copy(update={"integration_rate": coarse}), limits, seed
    )
    prbs = experiment.draw(PRBS, seed)
    if check_flag(owner, "gentle", gentle):
        speeds = [mean_speed(experiment.respond(command)) for command in prbs]
        experiment = replace(
            experiment, limits={**limits, "joint_velocity": float(np.mean(speeds))}
        )
    reference = experiment.variances(prbs)
    generations = range(GENERATIONS)
    iterator = generations if progress is None else progress(generations)
    weights = _search(experiment, reference, seed, iterator)
    commands = experiment.draw(_dwells(weights), seed, GENERATIONS)
    mean_amplitude = float(np.mean([largest_magnitude(command) for command in commands]))
    if mean_amplitude < LEAST_AMPLITUDE * amplitude:
        raise ValueError(
            f"{owner}: the limits leave ±{mean_amplitude:.2g} rad of ±{amplitude:g} rad: raise torque or "
            "servo_velocity, or ask for a smaller amplitude."
        )
    variances = experiment.variances(commands)
    ratios = _ratios(variances, reference)
    if max(ratios.values()) > 1.0:
        warnings.warn(
            f"{owner}: within these limits no dwell times were found that tell more than a PRBS of 100 ms: "
            "record that.",
            UserWarning,
            stacklevel=2,
        )
    longer = (seconds - LOST_TIME) / (COMPARED_DURATION - LOST_TIME)
    return PerturbationDesign(
        weights=dict(zip(DWELL_TIMES, weights.tolist(), strict=True)),
        amplitude=mean_amplitude,
        time_ratio=ratios,
        standard_errors={name: (variance / longer) ** 0.5 for name, variance in variances.items()},
        seconds=seconds,
        experiment=experiment,
    )


def _check_seconds(owner: str, seconds: float) -> float:
    """Check the length of a sequence [s]."""
    return check_number(owner, "seconds", seconds, "s", ge=1, le=LONGEST_RECORD)


def _dwells(weights: Iterable[float]) -> dict[str, Any]:
    """Settings of a perturbation with weights of its dwell times."""
    return {"perturbation": "dwells", "dwell_weights": tuple(weights)}


def _ratios(variances: Mapping[str, float], reference: Mapping[str, float]) -> dict[str, float]:
    """Ratios of the times for the same standard errors, of the parameters that there are."""
    return {
        name: variances[name] / reference[name]
        for name in COMPARED_PARAMETERS
        if np.isfinite(reference[name])
    }


def _search(
    experiment: Experiment, reference: Mapping[str, float], seed: int, generations: Iterable[int]
) -> np.ndarray:
    """Weights of the dwell times, by an evolution strategy with cumulative steps (Hansen and Ostermeier 2001).

    All children of a generation have the same random numbers, and every generation has others.
    """
    rng = np.random.default_rng(seed)
    size = len(DWELL_TIMES)
    mean = np.zeros(size)
    path = np.zeros(size)
    spread = 1.0
    shares = np.log(PARENTS + 0.5) - np.log(np.arange(1, PARENTS + 1))
    shares /= shares.sum()
    parents = 1.0 / np.sum(shares**2)
    memory = (parents + 2.0) / (size + parents + 5.0)
    gain = np.sqrt(memory * (2.0 - memory) * parents)
    for generation in generations:
        steps = rng.standard_normal((CHILDREN, size))
        costs = []
        for step in steps:
            child = _dwells(_normalise(mean + spread * step))
            commands = experiment.draw(child, seed, generation, count=SEQUENCES)
            ratios = _ratios(experiment.variances(commands), reference).values()
            costs.append(max(ratios) + SUM_SHARE * sum(ratios))
        best = np.argsort(costs)[:PARENTS]
        mean_step = shares @ steps[best]
        mean = mean + spread * mean_step
        path = (1.0 - memory) * path + gain * mean_step
        length = np.linalg.norm(path) / np.sqrt(size)
        spread *= np.exp(memory / (1.0 + memory) * (length - 1.0))
    return _normalise(mean)


def _normalise(logarithms: np.ndarray) -> np.ndarray:
    """Weights of unit sum from their logarithms."""
    weights = np.exp(logarithms - logarithms.max())
    return weights / weights.sum()
