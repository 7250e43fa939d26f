"""Whether the reference carries an estimate by `riv`: how strong its instruments are, and whether the torque answers."""

from __future__ import annotations

import numpy as np
from scipy import linalg

from ankleloop.checks.findings import Finding
from ankleloop.joint.regressors import MOTION
from ankleloop.methods.riv.alternatives import normal_score
from ankleloop.methods.riv.equations import Point
from ankleloop.methods.riv.search import Search
from ankleloop.signals.responses import count_taps

WEAK = 10.0  # F statistic of weak instruments (Staiger and Stock 1997)
# Normal score of all linear parameters together: measured, at most 3.4 with the torque of another record (96 of them),
# and 15 or more where the instruments are not weak (134 records of subjects who push).
RELATED = 6.0
LARGEST_F = 1e6  # of instruments that are the regressors themselves


def measure_strength(point: Point) -> float:
    r"""F statistic of the direction of the movement that the instruments explain least.

    The regressors are those of K, B and I, and the reflex torque, whatever the number of basis functions behind it.

    With the smallest canonical correlation ρ of regressors and instruments, both whitened as the equations weight them,
    n independent samples and q taps of the response to the reference that the instruments are made of,

    .. math:: F = \frac{\rho^2}{1 - \rho^2} \, \frac{n - q}{q} .

    By a reference that has nothing to do with the movement it is about 1 or less, however long the record is (Staiger
    and Stock, Econometrica 65(3), 557-586, 1997; Cragg and Donald, Econometric Theory 9(2), 222-240, 1993).
    """
    equations = point.equations
    columns = [
        _whiten_directions(point, spectra) for spectra in (point.regressors, point.instruments)
    ]
    correlation = np.cos(linalg.subspace_angles(*columns)[0])
    taps = count_taps(equations.records[0].rate)
    samples = 2.0 * point.noise.size / equations.band.correlation
    explained = correlation**2
    ratio = explained / max(1.0 - explained, 1.0 / LARGEST_F)
    return float(ratio * max(samples - taps, 0.0) / taps)


def _whiten_directions(point: Point, spectra: np.ndarray) -> np.ndarray:
    """Inputs of K, B and I and the reflex torque, as the equations weight them, real and imaginary parts.

    Shapes: spectra (unknowns, frequencies), returns (2 frequencies, 4), or 3 of a joint without a reflex.
    """
    coefficients = point.parameters.linear[MOTION:]
    reflex = coefficients @ spectra[MOTION : MOTION + coefficients.size]
    rows = spectra[:MOTION]
    if not point.parameters.passive:
        rows = np.vstack([rows, reflex])
    rows = rows / np.sqrt(point.level)
    return np.hstack([rows.real, rows.imag]).T


def check_strength(solution: Search) -> Finding:
    """Whether the reference is strong enough an instrument for every direction of the movement."""
    name = solution.equations.records[0].reference_name
    strength = measure_strength(solution.point)
    text = (
        f"the direction of the movement that {name} explains least has an F statistic of {strength:.3g}, and weak "
        f"instruments have less than {WEAK:g}"
    )
    if strength >= WEAK:
        return Finding("reference", "ok", f"{text}.")
    return Finding(
        "reference",
        "refused",
        f"{text}: it is too weak an instrument. Is it the command of the servo? Give that as reference "
        "(reference='position' is for records in open loop); else record longer, or perturb more strongly.",
    )


def check_answer(solution: Search) -> Finding:
    """Whether the torque has to do with the movement that the reference explains."""
    linear = solution.point.parameters.linear
    block = slice(linear.size)
    score = abs(normal_score(linear, solution.covariance[block, block]))
    text = f"the torque answers the movement that the reference explains: {score:.3g} standard errors"
    if score >= RELATED:
        return Finding("relation", "ok", f"{text}.")
    return Finding(
        "relation",
        "refused",
        f"{text}, as that of any other record would by chance: K, B, I and G say nothing about the joint. Check the "
        "channels and the perturbation.",
    )
