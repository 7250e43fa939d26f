"""Refined instrumental variables: physical parameters that torque fed back through the load cannot bias."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np
from scipy import special
from scipy.fft import dct

from ankleloop.joint.estimate import Estimate
from ankleloop.joint.models import ModelInputs, PhysicalModel
from ankleloop.joint.prepared import PreparedTrial, make_regressors
from ankleloop.joint.regressors import MOTION, merge_torques
from ankleloop.methods.method import (
    NOMINAL_DELAY,
    POSITION,
    BasisOptions,
    Method,
    Offer,
    RefinedOptions,
    Validity,
)
from ankleloop.methods.riv.alternatives import (
    find_alternatives,
    has_stretch_delay,
    with_alternatives,
)
from ankleloop.methods.riv.equations import INCOMPLETE, Equations, Point
from ankleloop.methods.riv.search import Search, solve
from ankleloop.options import option
from ankleloop.quantities import STIFFNESS
from ankleloop.signals.least_squares import solve_scaled
from ankleloop.signals.vaf import TWO_SIDED

SCORE_CORRELATION = 1.0  # s: over this the products of residual and instruments may be correlated
DRIFT_COSINES = 2  # those that a drift within the record would fill
FEWEST_COSINES = 8  # of a short record
LOGARITHMIC = ("omega_n", "zeta", "pole")  # parameters whose logarithms are normally distributed
WIDEST_INTERVAL = 50.0  # of such a logarithm
CERTAIN_DELAY = 0.005  # s, standard error
GRADIENT_STEP = 0.1  # of a standard deviation of a coefficient, for the slopes of G and threshold


class RivOptions(RefinedOptions, BasisOptions):
    """Options of refined instrumental variables."""

    intervals: Literal["asymptotic", "robust"] | None = option(
        None,
        "asymptotic, for a complete model; robust, for an incomplete one; null: as the residual shows",
    )


def identify_riv(trials: Sequence[PreparedTrial], options: RivOptions) -> Estimate:
    r"""Estimate K, B, I and the reflex by refined instrumental variables, consistent in closed loop.

    The model is continuous in time,

    .. math:: TQ = K P + B \dot P + I \ddot P + e^{-s\tau} \frac{\omega_n^2}{s^2 + 2\zeta\omega_n s + \omega_n^2}
              \sum_k c_k\, g_k(\dot P) + v,

    with p / (s + p) as a further factor where `order` is 3, and v of any spectrum: voluntary torque and noise, which
    the load feeds back to P. The instruments are made of the reference alone. The position that the reference explains,
    a finite response to leads and lags of it, goes through the same model as the measured one, and the derivatives ψ of
    the torque with respect to the parameters θ, made of it, replace those of the measured position on the left:

    .. math:: \sum_f \Re\, \bar\psi(f)\, \hat\Phi_v(f)^{-1} \left[TQ(f) - \hat{TQ}(f; \hat\theta)\right] = 0.

    Weighting by the noise spectrum corresponds to prewhitening in time. Spectrum and derivatives are
    those of the parameters (Young 2011; Gilson, Garnier, Young and Van den Hof 2011). Of several trials the
    sums go over the frequencies of all of them, each with its own mean; the response to the reference and the noise
    spectrum are common to them. The search for the solution
    never ends worse than its start (`ankleloop.methods.riv.search.solve`), which is the best of a grid of dynamics for
    the predicted position, a fit to the torque that the reference explains.

    Intervals are for the parameters that the same model would have on an infinitely long record. Where the residual
    depends on the movement, the model is incomplete and asymptotic intervals do not hold: they are then robust
    (`robust_covariance`). There are none if the search has not converged.

    Parameters
    ----------
    trials : sequence of PreparedTrial
        One trial, or several of one joint in one condition.
    options : RivOptions
        A delay that is not given is estimated where the record shows it within a few milliseconds;
        elsewhere it is assumed to be 40 ms.

    Returns
    -------
    Estimate
        With 95 % intervals of K, B, I, G, ωn, ζ, of the third pole, of the threshold where the basis can have one, and
        of the delay where it is estimated. `diagnostics`: iterations, converged, criterion_start, criterion (size of
        the equations' left side at start and end, in units of its standard deviation, squared), intervals (asymptotic,
        robust or None), movement_p (probability of a residual that depends as much on the movement, if the model were
        complete), standard_errors,
        noise_frequency [Hz], noise_spectrum [(N·m)²/Hz], and alternatives: effects of the instruments or of the joint
        that the record shows and the model does not have, with
        their scores (size over standard error) and the relative shifts of K, B, I and G
        (`ankleloop.methods.riv.alternatives`). Intervals hold the values with the first of them. Where a warning asks
        for options of `read_trial`, `remedy` has their values.

    References
    ----------
    P. C. Young, "Recursive Estimation and Time-Series Analysis", Springer, 2011. M. Gilson, H. Garnier, P. C. Young,
    P. Van den Hof, "Optimal instrumental variable method for closed-loop identification", IET Control Theory
    Appl. 5(10), 1147-1154, 2011.

    Examples
    --------
    >>> from ankleloop.methods.registry import identify
    >>> from ankleloop.simulation.simulate import simulate
    >>> estimate = identify(simulate(seed=1, voluntary=0.3), "riv")
    >>> low, high = estimate.intervals["K"]
    >>> low < 150.0 < high
    True
    """
    solution = _solve(trials, options, estimate_delay=options.delay is None)
    assumptions = []
    if options.delay is None and not _shows_delay(solution):
        assumptions = [
            f"the reflex delay is {1000 * NOMINAL_DELAY:g} ms, since the record does not show it."
        ]
        solution = _solve(trials, options, estimate_delay=False)
    estimate = _estimate(trials, solution, options, assumptions)
    if not solution.converged:
        return estimate
    return with_alternatives(estimate, find_alternatives(solution), trials[0])


def _solve(trials: Sequence[PreparedTrial], options: RivOptions, *, estimate_delay: bool) -> Search:
    """Solution of the equations, with the delay as an unknown or not."""
    records = make_regressors(
        trials,
        basis=options.basis or "rectifier",
        degree=options.degree,
        delay=NOMINAL_DELAY if options.delay is None else options.delay,
        identification_rate=options.identification_rate,
        reference=options.reference,
    )
    equations = Equations(trials, records, options.weighting)
    return solve(equations, equations.find_start(options.order, estimate_delay=estimate_delay))


def _shows_delay(solution: Search) -> bool:
    """Whether a solution with the delay as an unknown has that of a stretch reflex, and with a small error."""
    point = solution.point
    if not solution.converged or not has_stretch_delay(point) or point.values["G"] < 0.0:
        return False
    variance = point.covariance(solution.free)[-1, -1]
    return bool(variance < CERTAIN_DELAY**2)


def _estimate(
    trials: Sequence[PreparedTrial],
    solution: Search,
    options: RivOptions,
    assumptions: list[str],
) -> Estimate:
    """Torques, physical parameters, and where the search has converged their intervals."""
    equations = solution.equations
    point = solution.point
    parameters = point.parameters
    reflex = point.values
    stiffness = {name: reflex.pop(name) for name in STIFFNESS}
    kind = None
    deviations: dict[str, float] = {}
    quantile = TWO_SIDED
    if solution.converged:
        kind = options.intervals or ("robust" if point.movement_p < INCOMPLETE else "asymptotic")
        deviations, quantile = _quantify(solution, kind)
    errors, intervals = estimate_intervals(point.values, deviations, quantile)
    inputs = ModelInputs.of(equations.records[0], reflex["delay"])
    band = equations.band.parts[0]
    noise = point.noise[: band.frequency.size]
    model = PhysicalModel(
        inputs=inputs,
        stiffness=parameters.linear[:MOTION],
        coefficients=parameters.linear[MOTION:],
        dynamics=parameters.dynamics,
    )
    return Estimate(
        method="riv",
        torque=merge_torques([model.predict(trial) for trial in trials]),
        stiffness=stiffness,
        reflex=reflex,
        intervals=intervals,
        diagnostics={
            "order": options.order,
            "iterations": len(solution.points) - 1,
            "converged": solution.converged,
            "criterion_start": solution.points[0].merit(solution.free),
            "criterion": point.merit(solution.free),
            "reference": options.reference,
            "intervals": kind,
            "movement_p": point.movement_p,
            "standard_errors": errors,
            "noise_frequency": band.frequency,
            "noise_spectrum": noise / band.density,
            "nonlinearity": point.reflex_path.curve(),
            "assumptions": assumptions,
            "warnings": _warnings(solution),
        },
        predictor=model,
    )


def _quantify(solution: Search, kind: str) -> tuple[dict[str, float], float]:
    """Standard deviations for intervals of one kind, and half of such an interval over them."""
    point = solution.point
    if kind == "robust":
        covariance, freedom = robust_covariance(point, solution.free)
        quantile = float(special.stdtrit(freedom, 0.975))
    else:
        covariance = point.covariance(solution.free)
        quantile = TWO_SIDED
    return estimate_deviations(point, covariance, solution.free), quantile


def _warnings(solution: Search) -> list[str]:
    """What the search did not reach, and what the record does not show."""
    warnings = []
    order = len(solution.point.parameters.dynamics.values)
    if solution.points[-1].pole_out_of_band or "pole" in solution.held:
        remedy = "its gain or the record is too small for two"
        if order == 3:
            remedy = "take order=2"
        warnings.append(
            f"a pole of the reflex has left the band, so the record does not show {order}: {remedy}."
        )
    if not solution.converged:
        warnings.append(
            f"not converged after {len(solution.points) - 1} iterations: the best one is given, without intervals. "
            "The record hardly shows some of the parameters."
        )
    return warnings


def robust_covariance(point: Point, free: np.ndarray) -> tuple[np.ndarray, int]:
    r"""Covariance of the parameters about those of an infinitely long record, whatever the residual is.

    The solution scatters as :math:`H^{-1} \sum_t s(t)`, H being the slope of the equations with that of weights and
    instruments, and s(t) the contribution of a time to their left side, see `time_scores`. A residual that depends on
    the movement correlates these contributions over time. Their spectrum at low frequencies is the variance of their
    sum: the mean of the squares of their first cosine transforms is it, from as many as there are segments of one
    second in the record (Müller, Journal of Econometrics 141(2), 1331-1352, 2007; Lazarus, Lewis, Stock and Watson,
    Journal of Business & Economic Statistics 36(4), 541-559, 2018). The estimate has as many degrees of freedom. The
    first two cosines are left out: they hold what drifts over the record, which the same record, repeated, would do
    again.

    Shapes: returns covariance (free, free).
    """
    band = point.equations.band
    segments = round(band.samples / band.rate / SCORE_CORRELATION)
    freedom = max(segments - DRIFT_COSINES, FEWEST_COSINES)
    first = 1 + DRIFT_COSINES  # the zeroth one is the mean
    transforms = dct(time_scores(point)[free], norm="ortho", axis=1)
    cosines = transforms[:, first : first + freedom]
    influence = solve_scaled(point.slope[np.ix_(free, free)], cosines)
    independent = 2.0 * point.noise.size / band.correlation
    factor = band.samples / freedom * independent / (independent - free.size)
    # Weights follow the residual whose scatter is computed here.
    factor *= 1.0 + point.equations.smoothing_variance
    return factor * influence @ influence.T, freedom


def time_scores(point: Point) -> np.ndarray:
    """Contributions of each time to the left side of the equations, shape (unknowns, samples).

    A sum over frequencies of two spectra is a sum over time of their signals: the weighted residual, and instruments
    with the same weights. Where the weights are an estimate from the residual, and residual and instruments are
    correlated at single frequencies though not on the whole, the squares of the residual contribute as well.
    """
    equations = point.equations
    band = equations.band
    root = np.sqrt(point.level)
    scores = band.contributions(point.instruments / root, point.residual / root)
    if equations.weighting == "noise":
        products = np.real(point.weighted * point.residual) / point.level
        filtered = equations.smooth_rows(products) * point.residual
        scores -= band.contributions(filtered, point.residual)
    return scores


def estimate_deviations(point: Point, covariance: np.ndarray, free: np.ndarray) -> dict[str, float]:
    """Standard deviations of the physical parameters, or of their logarithms; those of the reflex by differences."""
    path = point.reflex_path
    coefficients = slice(MOTION, point.parameters.linear.size)
    values = np.array(path.rectifier[:2])
    deviations = np.sqrt(np.diag(covariance))
    slopes = []
    for step in np.diag(GRADIENT_STEP * deviations[coefficients]):
        shifted = replace(path, coefficients=path.coefficients + step).rectifier[:2]
        slopes.append((np.array(shifted) - values) / step.sum())
    variances = np.transpose(slopes) @ covariance[coefficients, coefficients] @ slopes
    gain, threshold = np.sqrt(np.diag(variances)).tolist()
    names = np.array(point.names)[free].tolist()
    known = dict(zip(names, deviations.tolist(), strict=True))
    return {**known, "G": gain, "threshold": threshold}


def estimate_intervals(
    values: Mapping[str, float], deviations: Mapping[str, float], quantile: float
) -> tuple[dict[str, float], dict[str, tuple[float, float]]]:
    """Standard errors and intervals of parameters, some of which have the deviations of their logarithms."""
    errors = {}
    intervals = {}
    for name, value in values.items():
        if name not in deviations:
            continue
        deviation = deviations[name]
        margin = quantile * deviation
        if name in LOGARITHMIC:
            errors[name] = deviation * value
            ratio = float(np.exp(min(margin, WIDEST_INTERVAL)))
            intervals[name] = (value / ratio, value * ratio)
        else:
            errors[name] = deviation
            intervals[name] = (value - margin, value + margin)
    return errors, intervals


METHODS = (
    Method(
        "riv",
        RivOptions,
        identify_riv,
        merges=True,
        validity=Validity(closed={}, without_reference=POSITION),
        offer=Offer(
            "Refined instrumental variables",
            options_without_reference={"weighting": "flat"},
            candidates_without_reference={"order": [2, 3]},
        ),
    ),
)
