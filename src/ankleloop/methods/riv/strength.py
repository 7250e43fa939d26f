"""Whether the reference carries an estimate by `riv`: the strength of its instruments, and the answer of the torque."""

from __future__ import annotations

import numpy as np

from ankleloop.checks.findings import Finding
from ankleloop.joint.regressors import MOTION
from ankleloop.methods.riv.alternatives import normal_score
from ankleloop.methods.riv.equations import Point
from ankleloop.methods.riv.search import Search
from ankleloop.signals.least_squares import invert_scaled
from ankleloop.signals.responses import count_taps

WEAK = 10.0  # F statistic of weak instruments (Staiger and Stock 1997)
# Normal score of all linear parameters together: measured, at most 3.4 with the torque of another record (96 of them),
# and 15 or more where the instruments are not weak (134 records of subjects who push).
RELATED = 6.0
LARGEST_F = 1e6  # of instruments that are the regressors themselves


def measure_strength(point: Point) -> float:
    r"""F statistic of the instruments for K.

    With the share ρ² of the precision of K that instruments Z leave of that which the regressors X themselves would
    give, both whitened as the equations weight them, n independent samples, and q taps of the response to the reference
    that the instruments are made of,

    .. math:: \rho^2 = \frac{[(X'X)^{-1}]_{KK}}{[(Z'X)^{-1} Z'Z (X'Z)^{-1}]_{KK}}, \qquad
              F = \frac{\rho^2}{1 - \rho^2} \, \frac{n - q}{q} .

    X are the inputs of K, B and I, and the torque of the reflex, whatever basis it has. By a reference that has nothing
    to do with the movement F is about 1 or less, however long the record is (Staiger and Stock, Econometrica 65(3),
    557-586, 1997; for one of several regressors: Sanderson and Windmeijer, Journal of Econometrics 190(2), 212-221,
    2016).
    """
    equations = point.equations
    regressors = _whiten_directions(point, point.regressors)
    instruments = _whiten_directions(point, point.instruments)
    best = invert_scaled(regressors.T @ regressors)[0, 0]
    influence = invert_scaled(instruments.T @ regressors)[0]
    share = best / (influence @ (instruments.T @ instruments) @ influence)
    taps = count_taps(equations.records[0].rate)
    samples = 2.0 * point.noise.size / equations.band.correlation
    ratio = share / max(1.0 - share, 1.0 / LARGEST_F)
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
    """Whether the reference is strong enough an instrument."""
    name = solution.equations.records[0].reference_name
    strength = measure_strength(solution.point)
    text = (
        f"for K the instruments that {name} makes have an F statistic of {strength:.3g}, and weak ones have less than "
        f"{WEAK:g}"
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
    text = (
        f"the torque answers the movement that the reference explains: {score:.3g} standard errors"
    )
    if score >= RELATED:
        return Finding("relation", "ok", f"{text}.")
    return Finding(
        "relation",
        "refused",
        f"{text}, as that of any other record would by chance: K, B, I and G say nothing about the joint. Check the "
        "channels and the perturbation.",
    )
