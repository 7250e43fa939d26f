"""Whether two methods can be told apart by the torque that neither was fitted to."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import special

from ankleloop.joint.estimate import Estimate
from ankleloop.joint.prepared import PreparedTrial

BLOCK = 2.0  # s: longer than the squares of torques are correlated
FEWEST = 5  # blocks


@dataclass(frozen=True, eq=False)
class TorqueResidual:
    """Torque of a trial, and what a model leaves of it."""

    time: np.ndarray  # shape (N,): time in the trial [s]
    measured: np.ndarray  # shape (N,): measured torque [N·m]
    residual: np.ndarray  # shape (N,): measured less predicted torque [N·m]
    rate: float  # sampling rate [Hz]


@dataclass(frozen=True)
class VafDifference:
    """Difference of two VAFs on the same unseen data."""

    difference: float  # VAF of the first method less that of the second [points]
    low: float  # lower end of its 95 % interval
    high: float  # upper end of its 95 % interval


def torque_residual(trial: PreparedTrial, estimate: Estimate, *, trim: float = 0.0) -> TorqueResidual:
    """Torque of a trial, and what an estimate leaves of it, without the ends that are to be trimmed [s]."""
    time, rate = estimate.torque["time"].values, estimate.torque.attrs["identification_rate"]
    inside = (time >= time[0] + trim) & (time <= time[-1] - trim)
    measured = trial.channel_at("torque", time, rate)
    return TorqueResidual(time[inside], measured[inside], (measured - estimate.torque["net"].values)[inside], rate)


def compare_unseen(first: Sequence[TorqueResidual], second: Sequence[TorqueResidual]) -> VafDifference | None:
    r"""Difference of the VAFs of two methods, with an interval that knows that both predict the same torque.

    With residuals e₁ and e₂ of the torque y, each less its mean, the difference is

    .. math:: d = 100 \, \frac{\sum e_2^2 - \sum e_1^2}{\sum y^2}, \qquad
              \psi_t = 100 \, \frac{e_{2,t}^2 - e_{1,t}^2}{\overline{y^2}} - d \, \frac{y_t^2}{\overline{y^2}}

    and the mean of ψ is asymptotically normal around zero. Its variance comes from means over blocks of two seconds,
    its interval from Student's distribution. What is hard to predict for both methods cancels in it. None
    if too little was scored at the same rate.
    """
    differences, weights, blocks = [], [], []
    for a, b in zip(first, second, strict=True):
        _, rows_a, rows_b = np.intersect1d(np.round(a.time * a.rate), np.round(b.time * b.rate), return_indices=True)
        count = round(rows_a.size / (BLOCK * a.rate))
        if count and a.rate == b.rate:
            signals = a.measured[rows_a], a.residual[rows_a], b.residual[rows_b]
            y, e_a, e_b = ((x - x.mean()) ** 2 for x in signals)
            difference = 100.0 * float(np.sum(e_b - e_a) / np.sum(y))
            influence = (100.0 * (e_b - e_a) - difference * y) / y.mean()
            blocks += [block.mean() for block in np.array_split(influence, count)]
            differences.append(difference)
            weights.append(count)
    if len(blocks) < FEWEST:
        return None
    mean = float(np.average(differences, weights=weights))
    # Differences of several trials scatter as well.
    scatter = np.repeat(np.array(differences) - mean, weights) + np.array(blocks)
    margin = special.stdtrit(len(blocks) - 1, 0.975) * np.sqrt(np.mean(scatter**2) / (len(blocks) - 1))
    return VafDifference(mean, mean - float(margin), mean + float(margin))
