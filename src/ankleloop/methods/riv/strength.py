"""Whether the reference carries an estimate by `riv`: the strength of its instruments, and the answer of the torque."""

from __future__ import annotations

import numpy as np

from ankleloop.checks.findings import Finding
from ankleloop.joint.regressors import MOTION
from ankleloop.methods.riv.alternatives import normal_score
from ankleloop.methods.riv.equations import Point
from ankleloop.methods.riv.search import Search
from ankleloop.quantities import STIFFNESS
from ankleloop.signals.least_squares import invert_scaled
from ankleloop.signals.responses import count_taps

WEAK = 10.0  # F statistic of weak instruments (Staiger and Stock 1997)
# Normal score of all linear parameters together: measured, at most 3.4 with the torque of another record (96 of them),
# and 15 or more where the instruments are not weak (134 records of subjects who push).
RELATED = 6.0
MOST = 0.99  # of the power of a movement
LARGEST_F = 1e6  # of instruments that are the regressors themselves


def measure_strengths(point: Point) -> dict[str, float]:
    r"""F statistics of the instruments for K, B, I and G.

    With the share ρ² of the precision of a parameter that instruments Z leave of that which the regressors X themselves
    would give, both whitened as the equations weight them, n independent samples, and q taps of the response to the
    reference that the instruments are made of,

    .. math:: \rho^2 = \frac{[(X'X)^{-1}]_{KK}}{[(Z'X)^{-1} Z'Z (X'Z)^{-1}]_{KK}}, \qquad
              F = \frac{\rho^2}{1 - \rho^2} \, \frac{n - q}{q} .

    X are the inputs of K, B and I, and the torque of the reflex, whatever basis it has. By a reference that has nothing
    to do with the movement F is about 1 or less, however long the record is, and so it is for a parameter that a
    command of few frequencies cannot tell from the others (Staiger and Stock, Econometrica 65(3),
    557-586, 1997; for one of several regressors: Sanderson and Windmeijer, Journal of Econometrics 190(2), 212-221,
    2016).
    """
    equations = point.equations
    regressors = _whiten_directions(point, point.regressors)
    instruments = _whiten_directions(point, point.instruments)
    best = np.diag(invert_scaled(regressors.T @ regressors))
    influence = invert_scaled(instruments.T @ regressors)
    variances = np.diag(influence @ (instruments.T @ instruments) @ influence.T)
    shares = best / variances
    taps = count_taps(equations.records[0].rate)
    samples = 2.0 * equations.share * point.noise.size / equations.band.correlation
    ratios = shares / np.maximum(1.0 - shares, 1.0 / LARGEST_F)
    statistics = ratios * max(samples - taps, 0.0) / taps
    return dict(zip((*STIFFNESS, "G"), statistics.tolist(), strict=True))


def _whiten_directions(point: Point, spectra: np.ndarray) -> np.ndarray:
    """Inputs of K, B and I and the reflex torque, as the equations weight them, real and imaginary parts.

    Of a joint without a reflex the last one is what the reflex would answer.

    Shapes: spectra (unknowns, frequencies), returns (2 frequencies, 4).
    """
    coefficients = point.parameters.linear[MOTION:]
    if point.parameters.passive:
        coefficients = np.ones(coefficients.size)
    reflex = coefficients @ spectra[MOTION : MOTION + coefficients.size]
    rows = np.vstack([spectra[:MOTION], reflex]) / np.sqrt(point.level)
    return np.hstack([rows.real, rows.imag]).T


def _describe_band(solution: Search) -> str:
    """Up to which frequency the reference moves the joint."""
    equations = solution.equations
    power = np.cumsum(np.abs(equations.predicted[0]) ** 2)
    highest = equations.band.s.imag[np.searchsorted(power, MOST * power[-1])] / (2.0 * np.pi)
    name = equations.records[0].reference_name
    return f"{100 * MOST:g} % of the movement that {name} makes lie below {highest:.2g} Hz"


def check_strength(solution: Search) -> Finding:
    """Whether the reference is strong enough an instrument."""
    name = solution.equations.records[0].reference_name
    strength = measure_strengths(solution.point)["K"]
    text = (
        f"for K the instruments that {name} makes have an F statistic of {strength:.3g}, and weak ones have less than "
        f"{WEAK:g}"
    )
    if strength >= WEAK:
        return Finding("reference", "ok", f"{text}.")
    return Finding(
        "reference",
        "refused",
        f"{text}: it is too weak an instrument; {_describe_band(solution)}. Is it the command of the servo? Give that "
        "as reference (reference='position' is for records in open loop); else record longer, or perturb more strongly "
        "and at more frequencies.",
    )


def find_unshown(solution: Search) -> tuple[list[str], str]:
    """Parameters that the movement does not show though it shows K, and why."""
    if solution.equations.open_loop:  # every movement is an instrument
        return [], ""
    strengths = measure_strengths(solution.point)
    names = [name for name, strength in strengths.items() if strength < WEAK]
    reason = (
        f"{_describe_band(solution)}, and its instruments for them are weak (F statistic below {WEAK:g}): take a "
        "command with more power above that"
    )
    return names, reason


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
