"""The Cramér-Rao bound of a simulated experiment, for constant parameters and for trajectories."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
import xarray as xr

from ankleloop.assessment.scores import TRAJECTORY_TRUTHS
from ankleloop.errors import DataError
from ankleloop.joint.dynamics import ReflexDynamics
from ankleloop.joint.prepared import PreparedTrial, prepare
from ankleloop.methods.riv.equations import Parameters
from ankleloop.methods.riv_tv.equations import TimeVaryingEquations
from ankleloop.methods.riv_tv.options import RivTvOptions
from ankleloop.methods.riv_tv.riv_tv import PLACES
from ankleloop.options import check_flag, check_number
from ankleloop.quantities import QUANTITIES, SETTINGS, STIFFNESS
from ankleloop.signals.spectra import pass_band
from ankleloop.simulation.filters import ANTIALIAS_ORDER, bessel_denominator
from ankleloop.simulation.settings import SimulationSettings
from ankleloop.simulation.simulate import simulate

RECTIFIER_SLOPE = 0.5  # on average, for a velocity of zero mean
INFORMATION_PRECISION = 1e-14  # of eigenvalues of the information, relative to the largest one
QUIET_SETTINGS = {"snr_db": None, "voluntary": 0.0}
COURSES = {"cycle": {"cycle_onsets": "phase"}, "time": {}, "schedule": {"schedule": "schedule"}}


def cramer_rao(
    *,
    seed: int | np.random.SeedSequence,
    identification_rate: float = 100.0,
    fed_back: bool = True,
    known_delay: bool = True,
    **settings: Any,
) -> dict[str, float]:
    r"""Smallest standard deviation of K, B, I, G, ωn, ζ (and p, and the delay) from one trial.

    The torque is TQ = F(P; θ) + v, the position P = servo(r) − H·TQ. To first order in v, a change δθ changes the
    torque by S (ψ δθ + v), where ψ = ∂F/∂θ along the trajectory without v, and S is the sensitivity of the loop. S
    cancels, and the information of the record about θ is

    .. math:: M_{ab} = 2 \sum_f \frac{\Re\, \bar\psi_a(f) \psi_b(f)}{\Phi_v(f)}
              + \sum_f \frac{\partial \ln \Phi}{\partial \theta_a} \frac{\partial \ln \Phi}{\partial \theta_b},
              \qquad \Phi = |S|^2 \Phi_v .

    The second sum applies if the spectrum of v is known: then the power of the fed-back torque contains information
    about the loop.

    Assumptions: all frequencies between 0.05 Hz and the pass band (38 Hz at 100 Hz) are used and no others; v is
    Gaussian with a known spectrum, and all of it is fed back, as in the simulation. Load and servo may be unknown: the
    position has no measurement noise, so P = servo(r) − H·TQ determines them. In the second sum the rectifier is
    replaced by its mean slope.

    Parameters
    ----------
    seed : int or numpy.random.SeedSequence
        Seed of the trial, which determines its perturbation.
    identification_rate : float
        Rate of the identification [Hz].
    fed_back : bool
        Count the information in the known spectrum of the fed-back torque.
    known_delay : bool
        False estimates the delay, too.
    **settings
        Settings of the simulation, as `simulate` takes them.

    Returns
    -------
    dict of str to float
        Standard deviations by the names of `Estimate.stiffness` and `Estimate.reflex`: infinite for parameters on which
        the record does not depend (the reflex dynamics and the delay without a reflex, `reflex_gain=0`), 0 for all
        others without a disturbance (`snr_db=None, voluntary=0`).

    Raises
    ------
    TypeError, ValueError
        For settings that `simulate` refuses, and for a joint that varies or a reflex with a threshold, for which this
        bound is not derived.
    DataError
        If the record does not tell some of the other parameters apart, or does not move.

    See Also
    --------
    ankleloop.trajectory_bound : The same for parameters that change.
    ankleloop.plan_duration : How long to record for intervals of a width.

    Examples
    --------
    >>> bound = cramer_rao(seed=1, duration=20.0)
    >>> sorted(bound)
    ['B', 'G', 'I', 'K', 'omega_n', 'zeta']
    """
    rate = check_number(
        "cramer_rao", "identification_rate", identification_rate, "Hz", ge=1, le=10000
    )
    check_flag("cramer_rao", "fed_back", fed_back)
    check_flag("cramer_rao", "known_delay", known_delay)
    values = SimulationSettings.parse("cramer_rao", **settings)
    clean = prepare(_simulate_clean(seed, values))
    names, information = fisher_information(
        clean, values, rate, fed_back=fed_back, known_delay=known_delay
    )
    variances = parameter_variances(names, information)
    return {name: float(np.sqrt(variance)) for name, variance in variances.items()}


def parameter_variances(names: Sequence[str], information: np.ndarray) -> dict[str, float]:
    """Smallest variance of every parameter.

    Shapes: information (parameters, parameters).
    """
    covariance = invert_information(information, names)
    return dict(zip(names, np.diag(covariance).tolist(), strict=True))


def invert_information(information: np.ndarray, names: Sequence[str] | None = None) -> np.ndarray:
    """Smallest covariance of named parameters, or of splines; infinite variances where the record has no information.

    Shapes: information (parameters, parameters).
    """
    size = np.sqrt(np.diag(information))
    covariance = np.diag(np.where(size > 0, 0.0, np.inf))
    if np.isinf(size).any():
        return covariance
    known = np.flatnonzero(size > 0)
    select = np.ix_(known, known)
    scale = np.outer(size[known], size[known])
    scaled = information[select] / scale
    values, vectors = np.linalg.eigh(scaled)
    if not values[0] > len(values) * INFORMATION_PRECISION * values[-1]:
        confused = known[np.abs(vectors[:, 0]) > 0.1]
        parts = "the splines" if names is None else ", ".join(names[k] for k in confused)
        raise DataError(
            f"the record does not tell {parts} apart: their information is singular. "
            "Use a longer record, a richer perturbation, or fewer parameters."
        )
    covariance[select] = np.linalg.inv(scaled) / scale
    return covariance


def fisher_information(
    clean: PreparedTrial,
    settings: SimulationSettings,
    rate: float = 100.0,
    *,
    fed_back: bool = True,
    known_delay: bool = True,
    spectrum: Callable[[np.ndarray], np.ndarray] | None = None,
) -> tuple[list[str], np.ndarray]:
    """Names of the parameters, and the information of one trial, whose inverse gives the variances of `cramer_rao`.

    `clean` is the trial without disturbances; the spectrum of these over frequency may be given.

    Shapes: returns information (parameters, parameters).
    """
    for name in ("reflex_threshold", "variation", "movement", "locked_torque"):
        value = getattr(settings, name)
        if value:
            needed = "null" if name == "variation" else 0
            raise ValueError(
                "the bound is derived for constant parameters, random disturbances and a rectifier at zero velocity: "
                f"{name} must be {needed}, got {value}."
            )
    regressors = clean.regressors(delay=settings.delay, basis="rectifier", identification_rate=rate)
    band = pass_band(regressors.torque.size, regressors.rate)
    inputs = band.transform(regressors.inputs.T)
    names, derivatives = _derivatives(inputs, band.s, settings, known_delay)
    if spectrum is None:
        if not settings.disturbed:
            depends = np.abs(derivatives).any(axis=1)
            return names, np.diag(np.where(depends, np.inf, 0.0))
        level = settings.torque_level or float(np.std(clean.samples["torque"]))
        spectrum = partial(disturbance_spectrum, level=level, settings=settings)
    noise = spectrum(band.frequency) * band.density
    # The taper reduces leakage; the sum counts every frequency as the record without a taper would.
    information = 2.0 * np.real(derivatives.conj() / noise @ derivatives.T)
    if fed_back and settings.closed_loop:
        slopes = _spectral_slopes(band.s, settings, known_delay)
        information += slopes @ slopes.T
    return names, information


def _simulate_clean(
    seed: int | np.random.SeedSequence, settings: SimulationSettings, **changes: float
) -> xr.Dataset:
    """The trial of a bound without its random disturbances."""
    return simulate(seed=seed, **{**dict(settings), **QUIET_SETTINGS, **changes})


def _derivatives(
    inputs: np.ndarray, s: np.ndarray, settings: SimulationSettings, known_delay: bool
) -> tuple[list[str], np.ndarray]:
    """Names of K, B, I, G, the dynamics and the delay, and derivatives of the torque's spectrum with respect to them.

    `inputs`, shape (4, frequencies), are the spectra of P, Ṗ, P̈ and the rectified delayed velocity.
    """
    dynamics = ReflexDynamics(settings.omega_n, settings.zeta, settings.pole)
    response, relative = dynamics.response(s)
    names = [*STIFFNESS, "G", *dynamics.values]
    changes = [response]
    for derivative, value in zip(relative, dynamics.values.values(), strict=True):
        changes.append(settings.reflex_gain * derivative / value)
    if not known_delay:
        names.append("delay")
        changes.append(-s * settings.reflex_gain * response)
    return names, np.vstack([inputs[:3], inputs[3] * np.array(changes)])


def _spectral_slopes(s: np.ndarray, settings: SimulationSettings, known_delay: bool) -> np.ndarray:
    """Derivatives of ln |S|² with respect to the same parameters; S = 1 / (1 + F H)."""
    impedance = settings.load_inertia * s**2 + settings.load_viscosity * s + settings.load_stiffness
    velocity = s * np.exp(-s * settings.delay)
    motion = np.array([np.ones_like(s), s, s**2, RECTIFIER_SLOPE * velocity])
    names, derivatives = _derivatives(motion, s, settings, known_delay)
    values = [getattr(settings, SETTINGS[name]) for name in names[:4]]
    stiffness = values @ derivatives[:4]
    return -2.0 * np.real(derivatives / (impedance + stiffness))


def disturbance_spectrum(
    frequency: np.ndarray, level: float, settings: SimulationSettings
) -> np.ndarray:
    """Power spectral density of the voluntary torque and the measurement noise of a simulation.

    Shapes: frequency (F,); returns (F,).
    """
    deviation = settings.voluntary * level
    area = _integrate(_voluntary_power, settings, 0.5 * settings.recording_rate)
    density = deviation**2 * _voluntary_power(frequency, settings) / area
    if settings.snr_db is None:
        return density
    power = 0.5 * settings.noise_rate
    if settings.antialias_cutoff is not None:
        power = _integrate(_noise_power, settings, 20 * settings.noise_rate)
    variance = level**2 * 10 ** (-settings.snr_db / 10)
    return density + variance * _noise_power(frequency, settings) / power


def _voluntary_power(frequency: np.ndarray, settings: SimulationSettings) -> np.ndarray:
    """Squared gain of the filter of the voluntary torque, which is bilinear."""
    rate = settings.recording_rate
    cutoff = np.tan(np.pi * settings.voluntary_cutoff / rate)
    return _bessel_power(2, np.tan(np.pi * frequency / rate) / cutoff)


def _noise_power(frequency: np.ndarray, settings: SimulationSettings) -> np.ndarray:
    """Squared gain of the hold of the noise, and of the anti-aliasing filter."""
    power = np.sinc(frequency / settings.noise_rate) ** 2
    if settings.antialias_cutoff is None:
        return power
    return power * _bessel_power(ANTIALIAS_ORDER, frequency / settings.antialias_cutoff)


def _bessel_power(order: int, frequency: np.ndarray) -> np.ndarray:
    """Squared gain of a Bessel low-pass at frequencies that are relative to its cutoff."""
    denominator = bessel_denominator(order, 1.0)
    return np.abs(denominator[-1] / np.polyval(denominator, 1j * frequency)) ** 2


def _integrate(
    power: Callable[[np.ndarray, SimulationSettings], np.ndarray],
    settings: SimulationSettings,
    highest: float,
) -> float:
    """Area of a squared gain from zero to a frequency."""
    grid = np.linspace(0.0, highest, 40_001)
    return float(np.trapezoid(power(grid, settings), grid))


def trajectory_bound(
    *,
    seed: int | np.random.SeedSequence,
    knots: Sequence[int] = RivTvOptions.model_fields["knots"].default,
    identification_rate: float = 100.0,
    known_delay: bool = True,
    **settings: Any,
) -> xr.Dataset:
    r"""Smallest standard deviations of K, B and G over phase, time or schedule from one trial.

    The torque is TQ = F(P; θ) + e(τ) + v, with K, B and G in F splines whose coefficients are parameters, and an
    unknown e that repeats with the cycle, or changes slowly. To first order in v, a change δθ changes the torque by
    S (ψ δθ + v), where ψ = ∂F/∂θ along the trajectory without v. S, the sensitivity of the loop, changes in time, but
    the record determines it and it cancels: the information of the record about θ is that of ψ, whitened by the
    spectrum of v, less what repeats.

    Assumptions: as in `ankleloop.cramer_rao` without the information in the spectrum of the fed-back torque. The bound
    is that of estimates without bias. A method that smooths may have smaller errors, where the truth is smoother than
    the splines could be; its bias then counts in its errors.

    Parameters
    ----------
    seed : int or numpy.random.SeedSequence
        Seed of the trial, which determines its perturbation.
    knots : sequence of int
        Numbers of splines of K, B and G.
    identification_rate : float
        Rate of the identification [Hz].
    known_delay : bool
        False estimates the delay, too.
    **settings
        Settings of the simulation, as `simulate` takes them.

    Returns
    -------
    xarray.Dataset
        Standard deviations: K, B and G over "phase", "time" [s] or "schedule"; K_mean, B_mean and G_mean of their
        means, which smoothing does not change; I, omega_n, zeta (and pole, and delay). Those on which the record does
        not depend are infinite.

    Raises
    ------
    TypeError, ValueError
        For settings that `simulate` refuses, for a joint that does not change or a reflex with a threshold, and without
        a disturbance, where the bound is 0.
    DataError
        If the record does not tell the splines apart, or is too short.

    See Also
    --------
    ankleloop.cramer_rao : The same for constant parameters.

    Examples
    --------
    >>> bound = trajectory_bound(seed=1, variation="cycle", duration=42.0, stiffness_variation=0.4)
    >>> bound["K"].dims, bool(bound["K_mean"] < bound["K"].min())
    (('phase',), True)
    """
    check_flag("trajectory_bound", "known_delay", known_delay)
    values = SimulationSettings.parse("trajectory_bound", **settings)
    if values.variation is None or values.reflex_threshold != 0 or not values.disturbed:
        raise ValueError(
            "trajectory_bound is derived for a joint that varies, with a rectifier at zero velocity and a disturbance: "
            "set variation (the bound of a constant joint is that of cramer_rao), reflex_threshold=0, and snr_db or "
            "voluntary."
        )
    equations, parameters, information = trajectory_information(
        seed, values, knots, identification_rate, known_delay=known_delay
    )
    bases = equations.bases
    course = equations.course
    covariance = invert_information(information)
    places = np.linspace(0.0, 1.0, PLACES)
    low, high = course.limits
    bound = xr.Dataset(coords={course.dimension: low + (high - low) * places})
    for name in bases.trajectories:
        block = bases.blocks[name]
        weights = bases.splines[name](places)
        mean = weights[:-1].mean(axis=0)
        variances = np.sum(weights @ covariance[block, block] * weights, axis=1)
        bound[name] = (course.dimension, np.sqrt(variances))
        bound[f"{name}_mean"] = np.sqrt(mean @ covariance[block, block] @ mean)
    deviations = np.sqrt(np.diag(covariance))
    bound["I"] = deviations[bases.blocks["I"].start]
    for name, deviation in zip(parameters.unknowns, deviations[bases.size :], strict=True):
        bound[name] = deviation * parameters.dynamics.values.get(name, 1.0)
    for variable, curve in bound.data_vars.items():
        quantity = QUANTITIES[str(variable).removesuffix("_mean")]
        curve.attrs = {
            "units": quantity.unit,
            "long_name": f"smallest standard deviation of the {quantity.name}",
        }
    return bound


def trajectory_information(
    seed: int | np.random.SeedSequence,
    settings: SimulationSettings,
    knots: Sequence[int],
    rate: float = 100.0,
    *,
    known_delay: bool = True,
) -> tuple[TimeVaryingEquations, Parameters, np.ndarray]:
    """Equations of a trial without disturbances, parameters that are closest to the true ones, and their information.

    The inverse of the information gives the variances of `trajectory_bound`.

    Shapes: information (unknowns, unknowns): coefficients of K and B, the inertia, coefficients of G, logarithms of the
    dynamics, and the delay [s].
    """
    options = RivTvOptions.parse(
        "trajectory_bound",
        reference="position",
        identification_rate=rate,
        delay=settings.delay,
        knots=knots,
        **COURSES[str(settings.variation)],
    )
    clean = prepare(_simulate_clean(seed, settings))
    equations = TimeVaryingEquations([clean], options)
    bases = equations.bases
    rows = equations.course.rows
    linear = np.zeros(bases.size)  # without an inertia, of which nothing else depends
    for name, truth in TRAJECTORY_TRUTHS.items():
        values = clean.channel(truth, equations.grids[0])[rows]
        splines = bases.values[name][:, rows].T
        linear[bases.blocks[name]] = np.linalg.lstsq(splines, values, rcond=1e-12)[0]
    dynamics = ReflexDynamics(settings.omega_n, settings.zeta, settings.pole)
    parameters = Parameters(linear, dynamics, delays=() if known_delay else ("delay",))
    # The torque that the perturbation alone causes is the unit of the disturbances.
    still = _simulate_clean(seed, settings, movement=0.0, locked_torque=0.0)
    level = settings.torque_level or float(np.std(still["torque"].values))
    inside = equations.noise.inside
    density = np.ones(inside.size)
    density[inside] = disturbance_spectrum(equations.transform.frequency[inside], level, settings)
    # White noise has the variance of a density up to half of the rate.
    weighting = equations.noise.weigh(0.5 * equations.transform.rate * density)
    system = equations.system(parameters, equations.whitener(weighting))
    return equations, parameters, system.information
