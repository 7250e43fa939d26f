"""Refined instrumental variables: physical parameters that torque fed back through the load cannot bias."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import xarray as xr

from ankleloop.joint.basis import Basis
from ankleloop.joint.estimate import Estimate, torque_dataset
from ankleloop.joint.hammerstein import ReflexPath, StaticNonlinearity
from ankleloop.joint.prepared import PreparedTrial, prepare
from ankleloop.joint.regressors import Regressors
from ankleloop.methods.method import Method, Trial, degree_option, delay_option, rate_option
from ankleloop.methods.riv_equations import MOTION, RivEquations, RivParameters, RivSolution
from ankleloop.options import Options, option
from ankleloop.signals.decimation import decimate
from ankleloop.signals.vaf import TWO_SIDED
from ankleloop.subspace.input_matrices import simulate_response
from ankleloop.subspace.matrices import Matrices

__all__ = ["METHODS", "RivOptions", "identify_riv"]

NOMINAL_DELAY = 0.04  # s


class RivOptions(Options):
    """Options of refined instrumental variables."""

    order: Literal[2, 3] = option(2, "poles of the reflex dynamics (Eq. 2)")
    delay: float | None = delay_option(estimated=True)
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
    max_iterations: int = option(30, "most iterations", ge=1)
    tolerance: float = option(
        0.01,
        "the iteration ends when no parameter moves by more than this fraction of its standard error",
        gt=0,
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

    Weighting by the noise spectrum corresponds to prewhitening in time. Spectrum, derivatives and parameters are
    renewed in turn (Young 2011; Gilson, Garnier, Young and Van den Hof 2011), the linear parameters in closed form.
    The start is the best of a grid of dynamics for the predicted position, a fit to the torque that the reference
    explains.

    Parameters
    ----------
    trial : PreparedTrial
        The trial.
    options : RivOptions
        The options. A delay that is estimated lies between 15 and 150 ms.

    Returns
    -------
    Estimate
        With 95 % intervals of K, B, I, G, ωn, ζ, of the third pole, of the threshold where the basis can have one, and
        of the delay where it is estimated. `diagnostics`:
        iterations, converged, criterion_start, criterion, instrument_strength (smallest canonical correlation of
        instruments and regressors), explained (share of the position that the reference explains), standard_errors,
        noise_frequency [Hz] and noise_spectrum [(N·m)²/Hz].

    Raises
    ------
    DataError
        If the record is unusable, or the reference too weak an instrument.

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
    regressors = trial.regressors(
        delay=NOMINAL_DELAY if options.delay is None else options.delay,
        basis=options.basis or "rectifier",
        degree=options.degree,
        identification_rate=options.identification_rate,
        reference=options.reference,
    )
    equations = RivEquations(
        trial, regressors, options.order, estimate_delay=options.delay is None, weighting=options.weighting
    )
    start = equations.start()
    solution = equations.solve(start, options.max_iterations, options.tolerance)
    return _estimate(trial, equations, start, solution)


def _estimate(trial: PreparedTrial, equations: RivEquations, start: RivParameters, solution: RivSolution) -> Estimate:
    """Torques, physical parameters and their intervals."""
    regressors = equations.regressors
    parameters, warnings = _accept(equations, start, solution)
    nonlinearity = StaticNonlinearity(regressors.basis, parameters.linear[MOTION:])
    path = ReflexPath(nonlinearity, parameters.dynamics)
    values, errors, intervals = _physical_parameters(equations, parameters, path, solution.covariance)
    return Estimate(
        method="riv",
        torque=_simulate_torques(trial, regressors, parameters),
        matrices=_matrices(parameters, regressors),
        stiffness={name: values[name] for name in "KBI"},
        reflex={name: values[name] for name in values if name not in "KBI"},
        intervals=intervals,
        diagnostics={
            "order": equations.order,
            "iterations": solution.iterations,
            "converged": solution.converged,
            "criterion_start": solution.criteria[0],
            "criterion": solution.criteria[1],
            "instrument_strength": solution.strength,
            "explained": equations.explained,
            "reference": regressors.reference_name,
            "standard_errors": errors,
            "nonlinearity": nonlinearity.curve(),
            "noise_frequency": equations.band.frequency,
            "noise_spectrum": solution.noise / equations.band.density,
            "warnings": warnings,
        },
        predictor=_Predictor(parameters, regressors.basis, regressors.delay, regressors.rate),
    )


def _accept(equations: RivEquations, start: RivParameters, solution: RivSolution) -> tuple[RivParameters, list[str]]:
    """Parameters to report, the start where the iteration ended worse, and the warnings that go with them."""
    parameters, warnings = solution.parameters, []
    if not solution.converged:
        warnings.append(
            f"not converged after {solution.iterations} iterations: see the standard errors of its parameters."
        )
    if solution.criteria[1] > solution.criteria[0]:
        parameters = start
        warnings.append("the iteration ended worse than its start, which is what is returned: do not trust it.")
    if equations.delay_out_of_range(parameters):
        warnings.append(
            "the delay has left what a reflex can have (15 to 150 ms): give it, or take fewer basis functions."
        )
    if equations.pole_out_of_band(parameters):
        fewer = "take order=2" if equations.order == 3 else "its gain or the record is too small for two"
        warnings.append(
            f"a pole of the reflex has left the band, so the record does not show {equations.order}: {fewer}."
        )
    return parameters, warnings


def _simulate_torques(trial: PreparedTrial, regressors: Regressors, parameters: RivParameters) -> xr.Dataset:
    """Torques of a trial; the dynamics act at the recording rate."""
    intrinsic = regressors.joint_inputs.centred[0] @ parameters.linear[:MOTION]
    velocity = trial.velocity(regressors.delay + parameters.shift)
    drive = parameters.linear[MOTION:] @ regressors.basis(velocity)
    A, B, C, D = parameters.dynamics.matrices(trial.rate)
    recorded = simulate_response(A, B, C, D, drive[:, None])[:, 0]
    reflex = decimate(recorded, *regressors.grid)
    reflex -= reflex.mean()
    return torque_dataset(regressors.time, regressors.rate, net=intrinsic + reflex, intrinsic=intrinsic, reflex=reflex)


@dataclass(frozen=True)
class _Predictor:
    """Torques of another trial by the same parameters."""

    parameters: RivParameters
    basis: Basis
    delay: float
    rate: float

    def __call__(self, trial: Trial) -> xr.Dataset:
        prepared = prepare(trial)
        regressors = prepared.regressors(delay=self.delay, basis=self.basis, identification_rate=self.rate)
        return _simulate_torques(prepared, regressors, self.parameters)


def _physical_parameters(
    equations: RivEquations, parameters: RivParameters, path: ReflexPath, covariance: np.ndarray
) -> tuple[dict[str, float], dict[str, float], dict[str, tuple[float, float]]]:
    """Physical parameters, their standard errors and 95 % intervals."""
    deviations = np.sqrt(np.diag(covariance))
    linear = slice(MOTION, parameters.linear.size)
    values = dict(zip("KBI", map(float, parameters.linear[:MOTION]), strict=True))
    errors = dict(zip("KBI", map(float, deviations[:MOTION]), strict=True))
    values |= {"delay": float(equations.regressors.delay + parameters.shift)} | path.parameters
    errors |= _rectifier_errors(path.nonlinearity, covariance[linear, linear])
    relative_errors = dict(zip(parameters.dynamics.values, deviations[linear.stop :], strict=False))
    errors |= {name: float(values[name] * relative) for name, relative in relative_errors.items()}
    if equations.estimate_delay:
        errors["delay"] = float(deviations[-1])
    margins = {name: TWO_SIDED * error for name, error in errors.items()}
    intervals = {name: (values[name] - margin, values[name] + margin) for name, margin in margins.items()}
    for name, relative in relative_errors.items():  # their logarithms are normally distributed
        ratio = float(np.exp(min(TWO_SIDED * relative, 50.0)))
        intervals[name] = (values[name] / ratio, values[name] * ratio)
    return values, errors, intervals


def _rectifier_errors(nonlinearity: StaticNonlinearity, covariance: np.ndarray) -> dict[str, float]:
    """Standard errors of gain and threshold, by differences with respect to the coefficients."""
    if nonlinearity.basis.kind == "rectifier":
        return {"G": float(np.sqrt(covariance[0, 0]))}
    values = np.array(nonlinearity.fit_rectifier()[:2])
    steps = 0.1 * np.sqrt(np.diag(covariance))
    slopes = []
    for k, step in enumerate(steps):
        coefficients = nonlinearity.coefficients + step * np.eye(steps.size)[k]
        shifted = replace(nonlinearity, coefficients=coefficients).fit_rectifier()[:2]
        slopes.append((np.array(shifted) - values) / step)
    slope = np.array(slopes)
    errors = np.sqrt(np.diag(slope.T @ covariance @ slope))
    return dict(zip(("G", "threshold"), map(float, errors), strict=True))


def _matrices(parameters: RivParameters, regressors: Regressors) -> Matrices:
    """The model at the identification rate, for inputs that are linear between samples."""
    A, B, C, D = parameters.dynamics.matrices(regressors.rate)
    direct, gains = parameters.linear[:MOTION], parameters.linear[MOTION:]
    B = np.hstack([np.zeros((len(A), MOTION)), B * gains])
    D = np.concatenate([direct, D.item() * gains])[None, :]
    return Matrices(A, B, C, D, 1.0 / regressors.rate, (regressors.names, ("torque",)))


METHODS = (Method("riv", RivOptions, identify_riv),)
