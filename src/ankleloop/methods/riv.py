"""Refined instrumental variables: physical parameters that torque fed back through the load cannot bias."""

from dataclasses import dataclass, replace

import numpy as np

from ankleloop.joint.estimate import Estimate, torque_dataset
from ankleloop.joint.hammerstein import ReflexPath, StaticNonlinearity
from ankleloop.joint.regressors import build_regressors, recording_grid
from ankleloop.methods.riv_equations import MOTION, WEIGHTINGS, Parameters, Problem
from ankleloop.signals.decimation import decimate, differentiate
from ankleloop.signals.vaf import TWO_SIDED
from ankleloop.subspace.input_matrices import response
from ankleloop.subspace.matrices import Matrices

__all__ = ["identify_riv"]

NOMINAL_DELAY = 0.04  # s


def identify_riv(
    trial,
    *,
    order=2,
    delay=0.04,
    basis=None,
    degree=5,
    identification_rate=100.0,
    reference="reference",
    weighting="noise",
    max_iterations=30,
    tolerance=0.01,
):
    r"""Find K, B, I and the reflex by refined instrumental variables, consistent in closed loop.

    The model is continuous in time,

    .. math:: TQ = K P + B \dot P + I \ddot P + e^{-s\tau} \frac{\omega_n^2}{s^2 + 2\zeta\omega_n s + \omega_n^2}
              \sum_k c_k\, g_k(\dot P) + v,

    with p / (s + p) as a further factor where `order` is 3, and v of any spectrum: voluntary torque and noise, which
    the load feeds back to P. The instruments are made of the reference alone. The position that the reference explains,
    a finite response to leads and lags of it, goes through the same model as the measured one, and the derivatives ψ of
    the torque with respect to the parameters θ, made of it, replace those of the measured position on the left:

    .. math:: \sum_f \Re\, \bar\psi(f)\, \hat\Phi_v(f)^{-1} \left[TQ(f) - \hat{TQ}(f; \hat\theta)\right] = 0.

    Weighting by the noise spectrum is what prewhitening is in time. Spectrum, derivatives and parameters are renewed in
    turn (Young 2011; Gilson, Garnier, Young and Van den Hof 2011), the linear parameters in closed form. It starts from
    the best of a grid of dynamics for the predicted position, a fit to what the reference explains of the torque.

    Parameters
    ----------
    trial : xarray.Dataset
        The trial.
    order : {2, 3}
        Poles of the reflex dynamics (Eq. 2).
    delay : float or None
        Reflex delay [s]; None estimates it, between 15 and 150 ms.
    basis : {"rectifier", "chebyshev", "spline"}, optional
        Static nonlinearity, the half-wave rectifier by default.
    degree : int
        Number of terms of the other two.
    identification_rate : float
        Rate of the identification [Hz].
    reference : str
        Variable that the load cannot reach: the command of the servo, or "position" for an open-loop record.
    weighting : {"noise", "flat"}
        "noise" weights every frequency by the inverse of the noise spectrum, which is what is efficient where the model
        holds. Where it is a simplification, what it misses counts as noise, and goes unfitted; "flat" weighs all
        frequencies alike, so that the fit explains torque where the torque is large.
    max_iterations : int
        Most iterations.
    tolerance : float
        The iteration ends when no parameter moves by more than this fraction of its standard error.

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
    ValueError
        For an option out of its range.

    References
    ----------
    P. C. Young, "Recursive Estimation and Time-Series Analysis", Springer, 2011. M. Gilson, H. Garnier, P. C. Young,
    P. Van den Hof, "Optimal instrumental variable method for closed-loop identification", IET Control Theory
    Appl. 5(10), 1147-1154, 2011.

    Examples
    --------
    >>> from ankleloop.simulation import simulate
    >>> estimate = identify_riv(simulate(seed=1, voluntary=0.3))
    >>> low, high = estimate.intervals["K"]
    >>> low < 150.0 < high
    True
    """
    if order not in (2, 3):
        raise ValueError(f"order must be 2 or 3, got {order!r}.")
    if weighting not in WEIGHTINGS:
        raise ValueError(f"unknown weighting {weighting!r}; known: {', '.join(WEIGHTINGS)}.")
    if max_iterations < 1 or not tolerance > 0:
        raise ValueError(f"max_iterations and tolerance must be positive, got {max_iterations!r}, {tolerance!r}.")
    nominal = NOMINAL_DELAY if delay is None else delay
    regressors = build_regressors(
        trial,
        delay=nominal,
        basis=basis or "rectifier",
        degree=degree,
        identification_rate=identification_rate,
        reference=reference,
    )
    problem = Problem(trial, regressors, nominal, delay is None, order, weighting)
    start = problem.start()
    found = problem.refine(start, max_iterations, tolerance)
    return _estimate(trial, problem, start, found)


def _estimate(trial, problem, start, found):
    """Torques, physical parameters and their intervals."""
    regressors, parameters, warnings = problem.regressors, found.parameters, []
    if not found.converged:
        warnings.append(
            f"not converged after {found.iterations} iterations: see the standard errors of its parameters."
        )
    if found.criteria[1] > found.criteria[0]:
        parameters = start
        warnings.append("the iteration ended worse than its start, which is what is returned: do not trust it.")
    if problem.left_delays(parameters):
        warnings.append(
            "the delay has left what a reflex can have (15 to 150 ms): give it, or take fewer basis functions."
        )
    if problem.left_band(parameters):
        fewer = "take order=2" if problem.order == 3 else "its gain or the record is too small for two"
        warnings.append(
            f"a pole of the reflex has left the band, so the record does not show {problem.order}: {fewer}."
        )
    path = ReflexPath(StaticNonlinearity(regressors.basis, parameters.linear[MOTION:]), parameters.dynamics, 1.0, 1.0)
    values, errors, intervals = _physical(problem, parameters, path, found.covariance)
    return Estimate(
        method="riv",
        torque=_torques(trial, regressors, problem.delay, parameters),
        matrices=_matrices(parameters, regressors),
        stiffness={name: values[name] for name in "KBI"},
        reflex={name: values[name] for name in values if name not in "KBI"},
        intervals=intervals,
        diagnostics={
            "order": problem.order,
            "iterations": found.iterations,
            "converged": found.converged,
            "criterion_start": found.criteria[0],
            "criterion": found.criteria[1],
            "instrument_strength": found.strength,
            "explained": problem.explained,
            "reference": regressors.reference_name,
            "standard_errors": errors,
            "nonlinearity": path.nonlinearity.curve(),
            "noise_frequency": problem.band.frequency,
            "noise_spectrum": found.noise / problem.band.density,
            "warnings": warnings,
        },
        predictor=_Predictor(parameters, regressors.basis, problem.delay, regressors.rate),
    )


def _torques(trial, regressors, delay, parameters):
    """Torques of a trial; the dynamics act at the recording rate."""
    intrinsic = regressors.centred_inputs[0] @ parameters.linear[:MOTION]
    rate = float(trial.attrs["sampling_rate"])
    velocity = differentiate(trial["position"].values, rate, delay + parameters.shift)
    drive = parameters.linear[MOTION:] @ regressors.basis(velocity)
    recorded = response(*parameters.dynamics.matrices(rate), drive[:, None])[:, 0]
    reflex = decimate(recorded, *recording_grid(trial, regressors.rate, delay))
    reflex -= reflex.mean()
    return torque_dataset(regressors.time, regressors.rate, net=intrinsic + reflex, intrinsic=intrinsic, reflex=reflex)


@dataclass(frozen=True)
class _Predictor:
    """Torques of another trial by the same parameters."""

    parameters: Parameters
    basis: object
    delay: float
    rate: float

    def __call__(self, trial):
        regressors = build_regressors(trial, delay=self.delay, basis=self.basis, identification_rate=self.rate)
        return _torques(trial, regressors, self.delay, self.parameters)


def _physical(problem, parameters, path, covariance):
    """Physical parameters, their standard errors and 95 % intervals."""
    error = np.sqrt(np.diag(covariance))
    linear = slice(MOTION, parameters.linear.size)
    values = dict(zip("KBI", map(float, parameters.linear[:MOTION]), strict=True))
    errors = dict(zip("KBI", map(float, error[:MOTION]), strict=True))
    values |= {"delay": float(problem.delay + parameters.shift)} | path.parameters
    errors |= _rectifier_errors(path.nonlinearity, covariance[linear, linear])
    relative = dict(zip(parameters.dynamics.values, error[linear.stop :], strict=False))
    errors |= {name: float(values[name] * share) for name, share in relative.items()}
    if problem.free_delay:
        errors["delay"] = float(error[-1])
    spread = {name: TWO_SIDED * errors[name] for name in errors}
    intervals = {name: (values[name] - spread[name], values[name] + spread[name]) for name in errors}
    for name, share in relative.items():  # their logarithms are what is normal
        ratio = float(np.exp(min(TWO_SIDED * share, 50.0)))
        intervals[name] = (values[name] / ratio, values[name] * ratio)
    return values, errors, intervals


def _rectifier_errors(nonlinearity, covariance):
    """Standard errors of gain and threshold, by differences with respect to the coefficients."""
    if nonlinearity.basis.kind == "rectifier":
        return {"G": float(np.sqrt(covariance[0, 0]))}
    here = np.array(nonlinearity.rectifier()[:2])
    steps = 0.1 * np.sqrt(np.diag(covariance))
    moved = [
        replace(nonlinearity, coefficients=nonlinearity.coefficients + step).rectifier() for step in np.diag(steps)
    ]
    slope = np.array([(np.array(there[:2]) - here) / step for there, step in zip(moved, steps, strict=True)])
    errors = np.sqrt(np.diag(slope.T @ covariance @ slope))
    return dict(zip(("G", "threshold"), map(float, errors), strict=True))


def _matrices(parameters, regressors):
    """The model at the identification rate, for inputs that are linear between samples."""
    A, B, C, D = parameters.dynamics.matrices(regressors.rate)
    direct, gains = parameters.linear[:MOTION], parameters.linear[MOTION:]
    B = np.hstack([np.zeros((len(A), MOTION)), B * gains])
    D = np.concatenate([direct, D.item() * gains])[None, :]
    return Matrices(A, B, C, D, 1.0 / regressors.rate, (regressors.names, ("torque",)))
