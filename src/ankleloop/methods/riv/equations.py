"""The equations of refined instrumental variables, between spectra of measured and predicted inputs; their start."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
from scipy import special

from ankleloop.joint.dynamics import GRIDS, ReflexDynamics, respond
from ankleloop.joint.hammerstein import ReflexPath
from ankleloop.joint.prepared import PreparedTrial
from ankleloop.joint.regressors import MOTION, Regressors
from ankleloop.signals.least_squares import solve_scaled
from ankleloop.signals.spectra import Band, pass_band

NOISE_RESOLUTION = 0.4  # Hz
DELAY_LIMITS = (
    0.015,
    0.15,
)  # s: no stretch reflex is faster; a shorter delay could not be told from viscosity
FASTEST_POLE = (
    20.0  # of the highest frequency: a pole beyond [rad/s] acts like a delay of a millisecond
)
NO_POLE = 100.0  # of that limit: a third pole that is held there is none
INCOMPLETE = 0.01  # probability of a residual that depends as much on the movement, if the model were complete
REACH = 0.5  # s within which a residual may depend on the movement
WHITENING = 1.0  # Hz
DIFFERENCE = 1e-5  # of a logarithm, or s, for second derivatives
DELAYS = np.arange(0.02, 0.121, 0.01)  # s: candidates for the start of an unknown delay


@dataclass(frozen=True, eq=False)
class Parameters:
    """Parameters of a model: linear ones, the dynamics behind some of them, and delays."""

    linear: (
        np.ndarray
    )  # shape (k,): K, B, I and the coefficients of basis functions, or those of splines of them
    dynamics: ReflexDynamics  # dynamics of the reflex
    shift: float = 0.0  # delay of the reflex less that of the inputs [s]
    lag: float = 0.0  # lag of the torque channel behind the position [s]
    delays: tuple[str, ...] = ()  # those of "delay" and "torque_lag" that are unknowns

    @property
    def unknowns(self) -> tuple[str, ...]:
        """Names of the unknowns behind the linear ones: logarithms of the dynamics, and delays."""
        return (*self.dynamics.values, *self.delays)

    def add(self, step: np.ndarray) -> Parameters:
        """Parameters after a step of all unknowns."""
        linear, dynamics, late = np.split(
            step, np.cumsum([self.linear.size, len(self.dynamics.values)])
        )
        steps = dict(zip(self.delays, late.tolist(), strict=True))
        shift, lag = self.shift + steps.get("delay", 0.0), self.lag + steps.get("torque_lag", 0.0)
        return Parameters(
            self.linear + linear, self.dynamics.scale(dynamics), shift, lag, self.delays
        )

    def limit_delay(self, delay: float) -> Parameters:
        """Parameters whose delay, if it is an unknown, is that of a stretch reflex, by the delay of the inputs."""
        low, high = (limit - delay for limit in DELAY_LIMITS)
        return (
            replace(self, shift=min(max(self.shift, low), high)) if "delay" in self.delays else self
        )

    def responses(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Response of the reflex with its shift of the delay, and its derivatives with respect to its unknowns."""
        response, derivatives = self.dynamics.response(s)
        rows = np.array([*derivatives, -s * response] if "delay" in self.delays else derivatives)
        if self.shift:
            delay = np.exp(-s * self.shift)
            response, rows = delay * response, delay * rows
        return response, rows

    def torque(self, motion: np.ndarray, drive: np.ndarray, s: np.ndarray) -> np.ndarray:
        """Torque of inputs that act at once and of those of the dynamics, shapes (..., frequencies)."""
        return self.linear[: len(motion)] @ motion + self.responses(s)[0] * (
            self.linear[len(motion) :] @ drive
        )

    def differentiate(self, motion: np.ndarray, drive: np.ndarray, s: np.ndarray) -> np.ndarray:
        """Derivatives of that torque with respect to all unknowns, shape (unknowns, frequencies)."""
        response, rows = self.responses(s)
        spectra = [motion, response * drive, rows * (self.linear[len(motion) :] @ drive)]
        if "torque_lag" in self.delays:
            spectra.append(-s[None] * self.torque(motion, drive, s))
        return np.vstack(spectra)


class Point:
    """The equations at some parameters; weights and instruments are those of these parameters."""

    def __init__(self, equations: Equations, parameters: Parameters) -> None:
        e, p, linear = equations, parameters, parameters.linear
        self.equations, self.parameters = e, p
        self.names = (
            *"KBI",
            *(f"c{k}" for k in range(1, linear.size - MOTION + 1)),
            *p.unknowns,
        )  # of all unknowns
        self.path = ReflexPath(e.regressors.basis, linear[MOTION:], p.dynamics)
        # Whether a pole of the second-order part is so fast that it cannot be told from a delay.
        omega_n, zeta = p.dynamics.omega_n, p.dynamics.zeta
        self.pole_out_of_band = bool(
            omega_n * (zeta + np.sqrt(max(zeta**2 - 1.0, 0.0))) > e.pole_limit
        )
        # Derivatives of the torque with respect to the unknowns, by the measured inputs and by the predicted ones, both
        # of shape (unknowns, frequencies).
        self.regressors = e.differentiate(e.measured, p)
        self.instruments = self.regressors if e.open_loop else e.differentiate(e.predicted, p)
        # Shape (frequencies,): measured torque less that of the model, its smoothed periodogram, and the noise that the
        # weights are the inverse of.
        self.residual = e.torque - linear @ self.regressors[: linear.size]
        self.noise = e.smooth_power(self.residual)
        self.level = (
            self.noise if e.weighting == "noise" else np.full(self.noise.size, self.noise.mean())
        )
        self.weighted = self.instruments.conj() / self.level
        # Left side of the equations, zero at their solution; minus its slope for fixed weights and instruments; and
        # products of the instruments.
        self.side = np.real(self.weighted @ self.residual)
        self.normal = np.real(self.weighted @ self.regressors.T)
        self.information = np.real(self.weighted @ self.instruments.T)
        # Covariance of the left side where noise of this spectrum is all that is left; each frequency counts twice.
        self.scatter = (
            0.5
            * e.band.correlation
            * np.real((self.weighted * self.noise) @ self.weighted.conj().T)
        )

    @property
    def values(self) -> dict[str, float]:
        """K, B, I, delay and the parameters of the reflex, by name."""
        stiffness = dict(zip("KBI", self.parameters.linear[:MOTION].tolist(), strict=True))
        return {
            **stiffness,
            "delay": self.equations.delay + self.parameters.shift,
            **self.path.parameters,
        }

    def merit(self, free: np.ndarray) -> float:
        """Size of the left side of some unknowns over its standard deviation, squared: a χ² at the true parameters."""
        side = self.side[free]
        return float(side @ solve_scaled(self.scatter[np.ix_(free, free)], side))

    def covariance(self, free: np.ndarray) -> np.ndarray:
        """Covariance of some unknowns where the model is complete.

        Weights from the noise are an estimate themselves. To first order in the variance a of a smoothed periodogram
        over its square the equations scatter by 1 + 3a more than with the true spectrum, where this formula says 1 + a.

        Shapes: returns (free, free).
        """
        select = np.ix_(free, free)
        inverse = solve_scaled(self.normal[select], np.eye(free.size))
        return (
            (1.0 + 2.0 * self.equations.smoothing_variance)
            * inverse
            @ self.scatter[select]
            @ inverse.T
        )

    @cached_property
    def movement_p(self) -> float:
        """Probability of correlations of residual and movement at least as large, if the model were complete.

        The movement is what the instruments are made of: the predicted position, and the predicted drive of the
        reflex. In closed loop it does not depend on the noise, so that only a model that lacks something correlates
        the two. All are whitened. Lags within half a second are 1/(2b) apart in a band of width b; there the
        correlations of white signals are independent. The smaller one of the two probabilities counts, twice.
        """
        e, band = self.equations, self.equations.band
        drive = self.parameters.linear[MOTION:] @ e.predicted[MOTION:]
        residual = self.residual / np.sqrt(self.noise)
        first, count = band.bins.start, band.frequency.size
        size = 2 * (first + count)
        reach = int(REACH * size * band.rate / band.samples)
        probabilities = []
        for signal in (e.predicted[0], drive):
            cross = np.zeros(first + count + 1, dtype=complex)
            cross[first:-1] = (
                residual * signal.conj() / np.sqrt(band.smooth(np.abs(signal) ** 2, WHITENING))
            )
            products = 0.5 * size * np.fft.irfft(cross, size)[np.arange(-reach, reach + 1)]
            energy = np.sum(products**2) / (0.5 * count * band.correlation)
            probabilities.append(special.chdtrc(products.size, energy))
        return float(min(1.0, 2.0 * min(probabilities)))

    @cached_property
    def misfit(self) -> float:
        """Twice the negative log-likelihood of the torque less what the predicted inputs explain, but for a constant.

        With weights from the noise its spectrum is unknown (Whittle 1953), else it is white. In open loop its slope is
        the left side of the equations, but for the smoothing of weights.
        """
        e, linear = self.equations, self.parameters.linear
        remainder = (
            self.residual if e.open_loop else e.torque - linear @ self.instruments[: linear.size]
        )
        power = (
            e.smooth_power(remainder) if e.weighting == "noise" else np.mean(np.abs(remainder) ** 2)
        )
        return float(2.0 / e.band.correlation * remainder.size * np.mean(np.log(power)))

    @cached_property
    def slope(self) -> np.ndarray:
        """Minus the slope of the left side, weights and instruments being renewed, shape (unknowns, unknowns)."""
        e, p, slope = self.equations, self.parameters, self.normal.copy()
        linear, target = p.linear.size, self.residual / self.level
        # Instruments are the slopes of a torque, so their slopes are symmetric.
        for k, step in enumerate(DIFFERENCE * np.eye(len(slope))[linear:], linear):
            ahead, behind = (
                e.differentiate(e.predicted, p.add(sign * step)) for sign in (1.0, -1.0)
            )
            change = np.real((ahead - behind).conj() @ target) / (2.0 * DIFFERENCE)
            slope[:, k] -= change
            slope[k, :linear] -= change[:linear]
        if e.weighting == "noise":
            products = np.real(self.residual.conj() * self.regressors)
            noise_slopes = -2.0 * np.array(
                [e.band.smooth(row, NOISE_RESOLUTION) for row in products]
            )
            slope += np.real(self.weighted * self.residual) / self.level @ noise_slopes.T
        return slope


class Equations:
    """Spectra of the measured and of the predicted inputs of a trial, and the equations between them."""

    def __init__(self, trial: PreparedTrial, regressors: Regressors, weighting: str) -> None:
        self.regressors, self.weighting = regressors, weighting
        self.delay = float(regressors.delay)
        self.band = pass_band(regressors.torque.size, regressors.rate)
        # Variance of the smoothed spectrum over its square; zero for flat weights.
        self.smoothing_variance = (
            self.band.smoothing_variance(NOISE_RESOLUTION) if weighting == "noise" else 0.0
        )
        self.pole_limit = (
            FASTEST_POLE * self.band.highest
        )  # from which on a pole cannot be told from a delay [rad/s]
        self.torque = self.band.transform(regressors.torque)
        self.measured = self.band.transform(regressors.inputs.T)
        self.predicted_inputs = trial.predict_inputs(regressors)
        self.open_loop = self.predicted_inputs is regressors.inputs
        self.predicted = (
            self.measured if self.open_loop else self.band.transform(self.predicted_inputs.T)
        )

    def smooth_power(self, spectrum: np.ndarray) -> np.ndarray:
        """Smoothed periodogram, shape (frequencies,)."""
        power = self.band.smooth(np.abs(spectrum) ** 2, NOISE_RESOLUTION)
        return np.maximum(power, 1e-12 * power.max())

    def differentiate(self, spectra: np.ndarray, parameters: Parameters) -> np.ndarray:
        """Derivatives of the torque with respect to the parameters, by some inputs, shape (unknowns, frequencies)."""
        return parameters.differentiate(spectra[:MOTION], spectra[MOTION:], self.band.s)

    def hold_at_limits(self, parameters: Parameters) -> tuple[Parameters, set[str]]:
        """Parameters without a third pole or a delay beyond their limits, and the names of those that were."""
        limited = parameters.limit_delay(self.delay)
        names = set() if limited.shift == parameters.shift else {"delay"}
        if (parameters.dynamics.pole or 0.0) >= self.pole_limit:
            limited = replace(
                limited, dynamics=replace(limited.dynamics, pole=NO_POLE * self.pole_limit)
            )
            names.add("pole")
        return limited, names

    def find_start(self, order: int, *, estimate_delay: bool) -> Parameters:
        """Best of a grid of dynamics for the predicted position, a fit to the torque that it explains."""
        shifts, responses, delays = make_grid(
            self.band, order, self.delay if estimate_delay else None
        )
        linear, best, residual = fit_grid(
            self.predicted, self.torque, responses, delays, np.ones(self.torque.size)
        )
        if self.weighting == "noise":
            linear, best, _ = fit_grid(
                self.predicted, self.torque, responses, delays, self.smooth_power(residual)
            )
        number, late = divmod(best, shifts.size)
        shift = float(shifts[late])
        return Parameters(linear, GRIDS[order][number], shift, delays=("delay",) * estimate_delay)


@lru_cache(maxsize=2)
def make_grid(
    band: Band, order: int, delay: float | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Shifts of a delay from which a search may start, responses of the dynamics from which it may, and of the shifts.

    Shapes: returns shifts (D,), responses (R, F), delays (D, F).
    """
    shifts = np.zeros(1) if delay is None else DELAYS - delay
    return shifts, respond(GRIDS[order], band.s), np.exp(-np.outer(shifts, band.s))


def fit_grid(
    inputs: np.ndarray,
    torque: np.ndarray,
    responses: np.ndarray,
    delays: np.ndarray,
    noise: np.ndarray,
) -> tuple[np.ndarray, int, np.ndarray]:
    """Linear parameters of the best filter of the reflex, its number, and what it leaves of the torque.

    The filters are all pairs of a response and a delay, the latter counting first. They are fitted in one pass.

    Shapes: inputs (3 + k, F), torque (F,), responses (R, F), delays (D, F), noise (F,); returns (3 + k,), residual
    (F,).
    """
    motion, drive = inputs[:MOTION], inputs[MOTION:]
    k, count, size = len(drive), len(delays), len(responses) * len(delays)
    weighted = motion.conj() / noise
    normal = np.empty((size, MOTION + k, MOTION + k))
    normal[:, :MOTION, :MOTION] = np.real(weighted @ motion.T)
    rows = np.vstack(
        [(weighted[:, None] * drive).reshape(MOTION * k, -1), drive * torque.conj() / noise]
    )
    products = np.real(
        responses @ (delays[:, None] * rows).reshape(count * len(rows), -1).T
    ).reshape(size, -1)
    cross, reflex = np.split(products, [MOTION * k], axis=1)
    cross = cross.reshape(-1, MOTION, k)
    normal[:, :MOTION, MOTION:], normal[:, MOTION:, :MOTION] = cross, np.swapaxes(cross, 1, 2)
    products = (
        np.abs(responses) ** 2 @ np.real(drive.conj()[:, None] * drive / noise).reshape(k * k, -1).T
    )
    normal[:, MOTION:, MOTION:] = np.repeat(products, count, axis=0).reshape(-1, k, k)
    right = np.hstack([np.tile(np.real(weighted @ torque), (size, 1)), reflex])
    scale = 1.0 / np.sqrt(np.einsum("gii->gi", normal))
    scaled = normal * scale[:, :, None] * scale[:, None] + 1e-12 * np.eye(MOTION + k)
    linear = scale * np.linalg.solve(scaled, (scale * right)[..., None])[..., 0]
    best = int(np.argmax(np.sum(right * linear, axis=1)))  # explained energy
    values, response = linear[best], responses[best // count] * delays[best % count]
    return values, best, torque - values[:MOTION] @ motion - response * (values[MOTION:] @ drive)
