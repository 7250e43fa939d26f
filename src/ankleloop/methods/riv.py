"""Refined instrumental variables: physical parameters that torque fed back through the load cannot bias."""

from dataclasses import dataclass, replace

import numpy as np
from scipy import linalg

from ankleloop.errors import DataError
from ankleloop.estimate import Estimate, torque_dataset
from ankleloop.hammerstein import ReflexPath, StaticNonlinearity
from ankleloop.metrics import TWO_SIDED
from ankleloop.prediction import share_explained
from ankleloop.reflex import ReflexDynamics
from ankleloop.regressors import INTRINSIC_NAMES, build_regressors, predicted_inputs, recording_grid
from ankleloop.signals import PASSBAND, decimate, differentiate
from ankleloop.spectra import Band
from ankleloop.subspace.input_matrices import response
from ankleloop.subspace.matrices import Matrices

__all__ = ["identify_riv"]

LOWEST = 0.05  # Hz: drifts and means lie below
NOISE_RESOLUTION = 0.4  # Hz
NOMINAL_DELAY, DELAYS = 0.04, np.arange(0.01, 0.101, 0.01)  # s: where an unknown delay is looked for
LARGEST_STEP = 0.4  # of a natural frequency or damping in one iteration
LARGEST_DELAY_STEP = 0.01  # s
WEAKEST = 0.05  # share of the position that the reference predicts
FURTHEST = 20.0  # of the highest frequency: a pole beyond [rad/s] leaves no trace in the band
MOTION = len(INTRINSIC_NAMES)


def identify_riv(
    trial,
    *,
    order=2,
    delay=0.04,
    basis=None,
    degree=5,
    identification_rate=100.0,
    reference="reference",
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
        Reflex delay [s]; None estimates it.
    basis : {"rectifier", "chebyshev", "spline"}, optional
        Static nonlinearity, the half-wave rectifier by default.
    degree : int
        Number of terms of the other two.
    identification_rate : float
        Rate of the identification [Hz].
    reference : str
        Variable that the load cannot reach: the command of the servo, or "position" for an open-loop record.
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
    problem = _Problem(trial, regressors, nominal, delay is None, order)
    start = problem.start()
    found = problem.refine(start, max_iterations, tolerance)
    return _estimate(trial, problem, start, found)


@dataclass(frozen=True)
class _Parameters:
    """Linear parameters K, B, I, c₁ …, the dynamics behind the latter, and the delay."""

    linear: np.ndarray
    dynamics: ReflexDynamics
    shift: float = 0.0  # of the delay from the nominal one [s]

    def moved(self, step):
        """Parameters after a step of the linear ones, of the logarithms of the dynamics and of an unknown delay."""
        linear, dynamics, shift = np.split(step, np.cumsum([self.linear.size, len(self.dynamics.values)]))
        return _Parameters(self.linear + linear, self.dynamics.moved(dynamics), self.shift + shift.sum())


@dataclass(frozen=True)
class _Found:
    parameters: _Parameters
    covariance: np.ndarray  # of what a step of `_Parameters` holds
    iterations: int
    converged: bool
    criteria: tuple  # at the start and at the end
    strength: float
    noise: np.ndarray


class _Problem:
    """Spectra of the measured and of the predicted inputs, and the equations between them."""

    def __init__(self, trial, regressors, delay, free_delay, order):
        self.trial, self.regressors, self.order = trial, regressors, order
        self.delay, self.free_delay = delay, free_delay
        self.band = Band(regressors.torque.size, regressors.rate, LOWEST, PASSBAND * regressors.rate)
        self.torque = self.band.transform(regressors.torque)
        self.measured = self.band.transform(regressors.inputs.T)
        self.explained = self._check_reference()
        self.predicted = self.band.transform(predicted_inputs(trial, regressors, delay).T)

    def _check_reference(self):
        """Refuse a reference that does not move the joint."""
        r = self.regressors
        if r.reference_name == "position":
            return 1.0
        share = share_explained(r.inputs[:, 0], r.reference, r.rate)
        if share < WEAKEST:
            raise DataError(
                f"{r.reference_name} explains {100 * max(share, 0.0):.0f} % of the position: as an instrument it is "
                "too weak to say anything. Give the command of the servo as reference; reference='position' is for "
                "records in open loop."
            )
        return share

    def _terms(self, spectra, parameters):
        """Responses to the linear parameters; and to the other ones, given the linear ones."""
        response, derivatives = parameters.dynamics.response(self.band.s)
        late = np.exp(-self.band.s * parameters.shift)
        driven = late * spectra[MOTION:]
        combined = parameters.linear[MOTION:] @ driven
        others = [derivative * combined for derivative in derivatives]
        if self.free_delay:
            others.append(-self.band.s * response * combined)
        return np.vstack([spectra[:MOTION], response * driven]), np.array(others)

    def _residual(self, spectra, parameters):
        return self.torque - parameters.linear @ self._terms(spectra, parameters)[0]

    def _noise(self, residual):
        power = self.band.smoothed(np.abs(residual) ** 2, NOISE_RESOLUTION)
        return np.maximum(power, 1e-12 * power.max())

    def start(self):
        """Best of a grid of dynamics for the predicted position: a fit to what the reference explains."""
        shifts = DELAYS - self.delay if self.free_delay else [0.0]
        grid = [(dynamics, shift) for dynamics in ReflexDynamics.grid(self.order) for shift in shifts]
        noise = np.ones(self.band.s.size)
        for _ in range(2):
            best = min((self._fitted(dynamics, shift, noise) for dynamics, shift in grid), key=lambda fit: fit[0])[1]
            noise = self._noise(self._residual(self.predicted, best))
        return best

    def _fitted(self, dynamics, shift, noise):
        linear = np.zeros(self.measured.shape[0])
        terms = self._terms(self.predicted, _Parameters(linear, dynamics, shift))[0]
        weighted = terms.conj() / noise
        linear = linalg.solve(np.real(weighted @ terms.T), np.real(weighted @ self.torque), assume_a="pos")
        fitted = _Parameters(linear, dynamics, shift)
        return np.sum(np.abs(self._residual(self.predicted, fitted)) ** 2 / noise), fitted

    def refine(self, start, max_iterations, tolerance):
        """Iterate noise spectrum, derivatives and parameters."""
        parameters = start
        for iteration in range(1, max_iterations + 1):
            noise = self._noise(self._residual(self.measured, parameters))
            parameters = self._linear(parameters, noise)
            instruments, jacobian = (np.vstack(self._terms(x, parameters)) for x in (self.predicted, self.measured))
            weighted = instruments.conj() / noise
            normal = np.real(weighted @ jacobian.T)
            step = linalg.solve(normal, np.real(weighted @ self._residual(self.measured, parameters)))
            covariance = self._covariance(normal, np.real(weighted @ instruments.T))
            share = self._share(step)
            parameters = parameters.moved(share * step)
            if (parameters.dynamics.pole or 0.0) > FURTHEST * self.band.highest:
                converged = False
                break
            converged = share == 1.0 and np.all(np.abs(step) <= tolerance * np.sqrt(np.diag(covariance)))
            if converged and iteration > 1:
                break
        criteria = tuple(self._criterion(weighted, instruments, at) for at in (start, parameters))
        strength = _strength(instruments, jacobian, noise)
        return _Found(parameters, covariance, iteration, bool(converged), criteria, strength, noise)

    def _linear(self, parameters, noise):
        """Linear parameters in closed form, the dynamics being given."""
        instruments, terms = (self._terms(x, parameters)[0] for x in (self.predicted, self.measured))
        weighted = instruments.conj() / noise
        linear = linalg.solve(np.real(weighted @ terms.T), np.real(weighted @ self.torque))
        return _Parameters(linear, parameters.dynamics, parameters.shift)

    def _share(self, step):
        """Share of a step that stays within what one iteration may change."""
        largest = np.array([LARGEST_STEP] * self.order + [LARGEST_DELAY_STEP] * self.free_delay)
        return min(1.0, float(np.min(largest / np.maximum(np.abs(step[-largest.size :]), 1e-30))))

    def _covariance(self, normal, instruments):
        """Asymptotic covariance of the parameters; each frequency counts twice, as a complex number does.

        The weights are an estimate themselves. To first order in the variance a of a smoothed periodogram over its
        square the equations scatter by 1 + 3a more than with the true spectrum, where this formula says 1 + a.
        """
        inverse = linalg.inv(normal)
        estimated_weights = 1.0 + 2.0 * self.band.smoothing_variance(NOISE_RESOLUTION)
        return 0.5 * self.band.correlation * estimated_weights * inverse @ instruments @ inverse.T

    def _criterion(self, weighted, instruments, parameters):
        """Size of the instrumental equations' left side, in units of its standard deviation."""
        left = np.real(weighted @ self._residual(self.measured, parameters))
        return float(left @ linalg.solve(np.real(weighted @ instruments.T), left))


def _stacked(terms, target):
    """Real least squares from complex rows."""
    return np.hstack([terms.real, terms.imag]).T, np.concatenate([target.real, target.imag])


def _strength(instruments, jacobian, noise):
    """Smallest canonical correlation of instruments and regressors."""
    z, x = (np.linalg.qr(_stacked(part / np.sqrt(noise), part[0])[0])[0] for part in (instruments, jacobian))
    return float(np.linalg.svd(z.T @ x, compute_uv=False)[-1])


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
    if (parameters.dynamics.pole or 0.0) > FURTHEST * problem.band.highest:
        warnings.append("the third pole has left the band: the record shows two, so take order=2.")
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
    motion = regressors.inputs[:, :MOTION]
    intrinsic = (motion - motion.mean(axis=0)) @ parameters.linear[:MOTION]
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

    parameters: _Parameters
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
