"""The Cramér-Rao bound of a simulated experiment: what no unbiased method can do better than."""

import numpy as np
from scipy import signal as sps

from ankleloop.joint.dynamics import ReflexDynamics
from ankleloop.joint.regressors import build_regressors
from ankleloop.signals.decimation import PASSBAND
from ankleloop.signals.spectra import Band
from ankleloop.simulation import parameter_table, simulate

__all__ = ["cramer_rao", "disturbance_spectrum", "fisher_information"]

LOWEST = 0.05  # Hz
MEAN_SLOPE = 0.5  # of a rectifier, for a velocity of zero mean


def cramer_rao(*, seed, identification_rate=100.0, fed_back=True, known_delay=True, **parameters):
    r"""Smallest standard deviation of K, B, I, G, ωn, ζ (and p, and the delay) from one trial.

    The torque is TQ = F(P; θ) + v, the position P = servo(r) − H·TQ. To first order in v, a change δθ changes the
    torque by S (ψ δθ + v), with ψ = ∂F/∂θ along the trajectory without v, and S what the loop makes of both. S cancels,
    and the information of the record about θ is

    .. math:: M_{ab} = 2 \sum_f \frac{\Re\, \bar\psi_a(f) \psi_b(f)}{\Phi_v(f)}
              + \sum_f \frac{\partial \ln \Phi}{\partial \theta_a} \frac{\partial \ln \Phi}{\partial \theta_b},
              \qquad \Phi = |S|^2 \Phi_v .

    The second sum is there if the spectrum of v is known: then the size of what the loop makes of v tells of the loop.

    Assumptions: everything between 0.05 Hz and the pass band (38 Hz at 100 Hz) is used and nothing else; v is Gaussian
    with a known spectrum, and all of it is fed back, as in the simulation. Load and servo may be unknown: the
    position has no noise of its own, so P = servo(r) − H·TQ gives them away. In the second sum the rectifier is
    replaced by its mean slope.

    Parameters
    ----------
    seed : int
        The trial whose perturbation is meant.
    identification_rate : float
        Rate of the identification [Hz].
    fed_back : bool
        Count what the known spectrum of the fed-back torque tells of the loop.
    known_delay : bool
        False estimates the delay, too.
    **parameters
        Parameters of `simulate`.

    Returns
    -------
    dict of str to float
        Standard deviations by the names of `Estimate.stiffness` and `Estimate.reflex`.

    Examples
    --------
    >>> bound = cramer_rao(seed=1, duration=20.0)
    >>> sorted(bound)
    ['B', 'G', 'I', 'K', 'omega_n', 'zeta']
    """
    names, matrix = fisher_information(
        seed=seed,
        identification_rate=identification_rate,
        fed_back=fed_back,
        known_delay=known_delay,
        **parameters,
    )
    return dict(zip(names, map(float, np.sqrt(np.diag(np.linalg.inv(matrix)))), strict=True))


def fisher_information(*, seed, identification_rate=100.0, fed_back=True, known_delay=True, **parameters):
    """Information of one trial, whose inverse is what `cramer_rao` takes its standard deviations from.

    Parameters
    ----------
    seed, identification_rate, fed_back, known_delay, **parameters
        As there.

    Returns
    -------
    names : list of str
        The parameters.
    information : ndarray, shape (parameters, parameters)
        In inverse squares of their units.
    """
    clean = simulate(seed=seed, **{**parameters, "snr_db": None, "voluntary": 0.0})
    told = dict(clean.attrs)
    for name in ("voluntary", "snr_db"):
        told[name] = parameters.get(name, parameter_table()[name]["default"])
    regressors = build_regressors(
        clean, delay=told["delay"], basis="rectifier", identification_rate=identification_rate
    )
    band = Band(regressors.torque.size, regressors.rate, LOWEST, PASSBAND * regressors.rate)
    names, derivatives = _derivatives(band.transform(regressors.inputs.T), band.s, told, known_delay)
    level = float(np.std(clean["torque"].values))
    noise = disturbance_spectrum(band.frequency, level, told) * band.density
    # The taper keeps leakage away; the sum counts every frequency as the record without a taper would.
    information = 2.0 * np.real(derivatives.conj() / noise @ derivatives.T)
    if fed_back and told["closed_loop"]:
        slopes = _spectral_slopes(band.s, told, known_delay)
        information += slopes @ slopes.T
    return names, information


def _dynamics(told):
    return ReflexDynamics(told["omega_n"], told["zeta"], told.get("pole"))


def _derivatives(inputs, s, told, known_delay):
    """Names, and derivatives of the torque's spectrum with respect to K, B, I, G, the dynamics and the delay."""
    dynamics = _dynamics(told)
    response, relative = dynamics.response(s)
    scaled = [told["reflex_gain"] * by / value for by, value in zip(relative, dynamics.values.values(), strict=True)]
    reflex = [inputs[3] * part for part in (response, *scaled)]
    names = ["K", "B", "I", "G", *dynamics.values]
    if not known_delay:
        names.append("delay")
        reflex.append(-s * told["reflex_gain"] * response * inputs[3])
    return names, np.vstack([inputs[:3], reflex])


def _spectral_slopes(s, told, known_delay):
    """Derivatives of ln |S|² with respect to the same parameters; S = 1 / (1 + F H)."""
    compliance = 1.0 / (told["load_inertia"] * s**2 + told["load_viscosity"] * s + told["load_stiffness"])
    motion = np.array([np.ones_like(s), s, s**2, MEAN_SLOPE * s * np.exp(-s * told["delay"])])
    derivatives = _derivatives(motion, s, told, known_delay)[1]
    linear = np.array([told["stiffness"], told["viscosity"], told["inertia"], told["reflex_gain"]]) @ derivatives[:4]
    return -2.0 * np.real(derivatives * compliance / (1.0 + linear * compliance))


def disturbance_spectrum(frequency, level, told):
    """Power spectral density of the voluntary torque and the noise that a simulation is told to have.

    Parameters
    ----------
    frequency : ndarray, shape (F,)
        Frequencies within the pass band of the recorder [Hz].
    level : float
        Standard deviation of the clean net torque [N·m].
    told : mapping
        Attributes of a simulated trial.

    Returns
    -------
    ndarray, shape (F,)
        One-sided density [(N·m)²/Hz].

    Examples
    --------
    >>> from ankleloop.simulation import simulate
    >>> told = simulate(seed=1, duration=5.0, voluntary=0.2).attrs
    >>> grid = np.linspace(0.0, 40.0, 4001)
    >>> bool(abs(np.trapezoid(disturbance_spectrum(grid, 1.0, told), grid) - 0.04 - 0.0724) < 0.001)
    True
    """
    rate = told["recording_rate"]
    sos = sps.bessel(2, told["voluntary_cutoff"], fs=rate, norm="mag", output="sos")
    whole = np.linspace(0.0, rate / 2, 20_001)
    power = np.abs(sps.freqz_sos(sos, np.concatenate([whole, frequency]), fs=rate)[1]) ** 2
    area = np.trapezoid(power[: whole.size], whole)
    voluntary = (told["voluntary"] * level) ** 2 * power[whole.size :] / area
    if told.get("snr_db") is None:
        return voluntary

    def held(at):
        return np.sinc(at / told["noise_rate"]) ** 2 * _recorder_power(at, told["antialias_cutoff"])

    wide = np.linspace(0.0, 20 * told["noise_rate"], 40_001)
    noise = 10 ** (-told["snr_db"] / 10) * held(frequency) / np.trapezoid(held(wide), wide)
    return voluntary + level**2 * noise


def _recorder_power(frequency, cutoff):
    """What the recorder's anti-aliasing filter leaves of power."""
    b, a = sps.bessel(4, 2 * np.pi * cutoff, analog=True, norm="mag")
    return np.abs(sps.freqs(b, a, 2 * np.pi * frequency)[1]) ** 2
