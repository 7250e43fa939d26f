"""Refined instrumental variables: physical parameters that torque fed back through the load cannot bias."""

from __future__ import annotations

from typing import Any, Literal

from ankleloop.joint.estimate import Estimate
from ankleloop.joint.models import ModelInputs, PhysicalModel
from ankleloop.joint.prepared import PreparedTrial
from ankleloop.joint.regressors import MOTION
from ankleloop.methods.method import INPUTS, NOMINAL_DELAY, Method, degree_option, delay_option, rate_option
from ankleloop.methods.riv.alternatives import STRETCH_DELAY, add_alternatives, find_alternatives, last_error
from ankleloop.methods.riv.covariance import choose_covariance, estimate_deviations, estimate_intervals
from ankleloop.methods.riv.equations import Equations
from ankleloop.methods.riv.search import Search, solve
from ankleloop.options import Options, option

CERTAIN_DELAY = 0.005  # s, standard error


class RivOptions(Options):
    """Options of refined instrumental variables."""

    order: Literal[2, 3] = option(2, "poles of the reflex dynamics (Eq. 2)")
    delay: float | None = delay_option(None, estimated=True)
    basis: Literal["chebyshev", "rectifier", "spline"] | None = option(
        None, "static nonlinearity; null for the method's own (rectifier)"
    )
    degree: int = degree_option()
    identification_rate: float = rate_option()
    reference: str = option(
        "reference",
        'variable of the trial that the load cannot reach: the command of the servo, or "position" in open loop',
    )
    weighting: Literal["noise", "flat"] = option(
        "noise",
        "weights of frequencies: the inverse of the noise spectrum, which is efficient where the model holds; or flat, "
        "which fits the torque where it is large and suits a model that is a simplification",
    )
    intervals: Literal["asymptotic", "robust"] | None = option(
        None,
        "asymptotic, for a model that describes all but noise; robust, for one that leaves out something that depends "
        "on the movement; null: robust where the residual depends on the movement",
    )
    max_iterations: int = option(50, "most iterations", ge=1, le=10000)
    tolerance: float = option(
        0.01,
        "the iteration ends when no parameter moves by more than this fraction of its standard error",
        gt=0,
        le=1,
    )


def identify_riv(trial: PreparedTrial, options: RivOptions) -> Estimate:
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
    those of the parameters (Young 2011; Gilson, Garnier, Young and Van den Hof 2011). The search for the solution
    never ends worse than its start (`ankleloop.methods.riv.search.solve`), which is the best of a grid of dynamics for
    the predicted position, a fit to the torque that the reference explains.

    Intervals are for the parameters that the same model would have on an infinitely long record. Where the residual
    depends on the movement, the model is incomplete and asymptotic intervals do not hold: they are then robust
    (`ankleloop.methods.riv.covariance.robust_covariance`). There are none if the search has not converged.

    Parameters
    ----------
    trial : PreparedTrial
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
        complete), interval_segment (length of the segments that robust intervals count [s]), standard_errors, and
        alternatives: effects of the instruments or of the joint that the record shows and the model does not have, with
        their scores (size over standard error) and the relative shifts of K, B, I and G
        (`ankleloop.methods.riv.alternatives`). Intervals hold the values with the first of them.

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
    solution, assumptions = _solve(trial, options, estimate_delay=options.delay is None), []
    if options.delay is None:
        values, (shortest, longest) = solution.point.values, STRETCH_DELAY
        plausible = solution.converged and shortest < values["delay"] < longest and values["G"] >= 0.0
        if not (plausible and last_error(solution) < CERTAIN_DELAY):
            assumptions = [f"the reflex delay is {1000 * NOMINAL_DELAY:g} ms, since the record does not show it."]
            solution = _solve(trial, options, estimate_delay=False)
    estimate = _estimate(trial, solution, options, assumptions)
    return add_alternatives(estimate, find_alternatives(solution)) if solution.converged else estimate


def _solve(trial: PreparedTrial, options: RivOptions, *, estimate_delay: bool) -> Search:
    inputs = options.model_dump(include={*INPUTS, "reference"}) | {"basis": options.basis or "rectifier"}
    inputs["delay"] = NOMINAL_DELAY if options.delay is None else options.delay
    regressors = trial.regressors(**inputs)
    equations = Equations(trial, regressors, options.weighting)
    start = equations.find_start(options.order, estimate_delay=estimate_delay)
    return solve(equations, start, options.max_iterations, options.tolerance)


def _estimate(trial: PreparedTrial, solution: Search, options: RivOptions, assumptions: list[str]) -> Estimate:
    """Torques, physical parameters, and their intervals where the search has converged."""
    point, regressors = solution.point, solution.equations.regressors
    parameters, values = point.parameters, point.values
    errors: dict[str, float] = {}
    intervals: dict[str, tuple[float, float]] = {}
    description: dict[str, Any] = {"intervals": None}
    if solution.converged:
        covariance, quantile, description = choose_covariance(point, solution.free, options.intervals)
        deviations = estimate_deviations(point, covariance, solution.free)
        errors, intervals = estimate_intervals(values, deviations, quantile)
    inputs = ModelInputs.of(regressors, values["delay"])
    model = PhysicalModel(inputs, parameters.linear[:MOTION], parameters.linear[MOTION:], parameters.dynamics)
    return Estimate(
        method="riv",
        torque=model.simulate(trial, inputs.regressors(trial) if parameters.delays else regressors),
        matrices=model.matrices,
        stiffness={name: values.pop(name) for name in "KBI"},
        reflex=values,
        intervals=intervals,
        diagnostics={
            "order": options.order,
            "iterations": len(solution.path) - 1,
            "converged": solution.converged,
            "criterion_start": solution.path[0].merit(solution.free),
            "criterion": point.merit(solution.free),
            "reference": options.reference,
            **description,
            "standard_errors": errors,
            "nonlinearity": point.path.nonlinearity.curve(),
            "assumptions": assumptions,
            "warnings": _warnings(solution),
        },
        predictor=model,
    )


def _warnings(solution: Search) -> list[str]:
    """What the search did not reach, and what the record does not show."""
    warnings, order = [], len(solution.point.parameters.dynamics.values)
    left_band = solution.path[-1].pole_out_of_band
    if left_band or "pole" in solution.held:
        fewer = "take order=2" if order == 3 else "its gain or the record is too small for two"
        warnings.append(f"a pole of the reflex has left the band, so the record does not show {order}: {fewer}.")
    if not solution.converged:
        names = dict.fromkeys("G" if name.startswith("c") else name for name in solution.flat)
        cause = "" if left_band else f" The record hardly shows a common change of {', '.join(names)}."
        warnings.append(
            f"not converged after {len(solution.path) - 1} iterations: the parameters are those of the best one, "
            f"without intervals.{cause}"
        )
    return warnings


METHODS = (Method("riv", RivOptions, identify_riv),)
