"""The equations of refined instrumental variables, between spectra of measured and of predicted inputs.

`Parameters` are numbers alone. `Equations` hold the spectra of the trials. A `Point` is both together: left side, slope
and covariance at some parameters, for which it calls `Equations.differentiate` and `Equations.smooth_power`. The search
(`riv.search.solve`) makes the points.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import inf

import numpy as np
from scipy import special

from ankleloop.errors import DataError
from ankleloop.joint.dynamics import GRIDS, ReflexDynamics
from ankleloop.joint.hammerstein import ReflexPath
from ankleloop.joint.prepared import PreparedTrial, predict_inputs
from ankleloop.joint.regressors import MOTION, Regressors
from ankleloop.methods.riv.start import fit_grid, make_grid
from ankleloop.quantities import STIFFNESS
from ankleloop.signals.least_squares import invert_scaled, solve_scaled
from ankleloop.signals.spectra import pass_bands

NOISE_RESOLUTION = 0.4  # Hz
POWER_FLOOR = 1e-12  # of the largest power of the noise
# s: no stretch reflex is faster; a shorter delay could not be told from viscosity
DELAY_LIMITS = (0.015, 0.15)
# of the highest frequency: a pole beyond [rad/s] acts like a delay of a millisecond
FASTEST_POLE = 20.0
NO_POLE = 100.0  # of that limit: a third pole that is held there is none
# probability of a residual that depends as much on the movement, if the model were complete
INCOMPLETE = 0.01
MOVEMENT_REACH = 0.5  # s within which a residual may depend on the movement
LEAST_BESIDE_FILTERS = 1.1  # s of each trial: these lags have to fit in on both sides
MOVEMENT_RESOLUTION = 1.0  # Hz: width over which the spectrum of the movement is smoothed
LEAST_RECORDED = 0.1  # share of the samples that no filled gap reaches
SLOPE_STEP = 1e-5  # of a logarithm, or s, for second derivatives
NOMINAL_DYNAMICS = ReflexDynamics(omega_n=40.0, zeta=1.0)  # of a reflex that is not there
SHOWN_REFLEX = 4.5  # normal score of a reflex beyond doubt
ABSENT_REFLEX = 3.0  # of one that a passive joint may seem to have


@dataclass(frozen=True, eq=False)
class Parameters:
    """Parameters of a model: linear ones, the dynamics behind some of them, and delays."""

    # Shape (k,): K, B, I and the coefficients of basis functions, or those of splines of them.
    linear: np.ndarray
    dynamics: ReflexDynamics  # dynamics of the reflex
    shift: float = 0.0  # delay of the reflex less that of the inputs [s]
    lag: float = 0.0  # lag of the torque channel behind the position [s]
    delays: tuple[str, ...] = ()  # those of "delay" and "torque_lag" that are unknowns
    # Whether the dynamics are no unknowns, as those of a joint without a reflex.
    passive: bool = False

    @property
    def unknowns(self) -> tuple[str, ...]:
        """Names of the unknowns behind the linear ones: logarithms of the dynamics, and delays."""
        return self.delays if self.passive else (*self.dynamics.values, *self.delays)

    def without_reflex(self) -> Parameters:
        """Parameters of a passive joint, whose dynamics are nominal."""
        delays = tuple(name for name in self.delays if name != "delay")
        return replace(self, dynamics=NOMINAL_DYNAMICS, shift=0.0, delays=delays, passive=True)

    def add(self, step: np.ndarray) -> Parameters:
        """Parameters after a step of all unknowns."""
        linear, others = np.split(step, [self.linear.size])
        changes = dict(zip(self.unknowns, others.tolist(), strict=True))
        logarithms = [changes.get(name, 0.0) for name in self.dynamics.values]
        return replace(
            self,
            linear=self.linear + linear,
            shift=self.shift + changes.get("delay", 0.0),
            lag=self.lag + changes.get("torque_lag", 0.0),
            dynamics=self.dynamics.scale(np.array(logarithms)),
        )

    def limit_delay(self, delay: float) -> Parameters:
        """Parameters whose delay, if it is an unknown, is that of a stretch reflex, by the delay of the inputs."""
        if "delay" not in self.delays:
            return self
        low, high = DELAY_LIMITS
        return replace(self, shift=min(max(self.shift, low - delay), high - delay))

    def responses(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Response of the reflex with its shift of the delay, and its derivatives with respect to its unknowns."""
        response, derivatives = self.dynamics.response(s)
        if self.passive:
            derivatives = []
        if "delay" in self.delays:
            derivatives.append(-s * response)
        rows = np.array(derivatives).reshape(-1, s.size)
        if not self.shift:
            return response, rows
        delay = np.exp(-s * self.shift)
        return delay * response, delay * rows

    def torque(self, intrinsic: np.ndarray, drive: np.ndarray, s: np.ndarray) -> np.ndarray:
        """Torque of inputs of the intrinsic path and of those of the reflex, shapes (..., frequencies)."""
        intrinsic_torque = self.linear[: len(intrinsic)] @ intrinsic
        return intrinsic_torque + self.responses(s)[0] * (self.linear[len(intrinsic) :] @ drive)

    def differentiate(self, intrinsic: np.ndarray, drive: np.ndarray, s: np.ndarray) -> np.ndarray:
        """Derivatives of that torque with respect to all unknowns, shape (unknowns, frequencies)."""
        response, rows = self.responses(s)
        whole_drive = self.linear[len(intrinsic) :] @ drive
        spectra = [intrinsic, response * drive, rows * whole_drive]
        if "torque_lag" in self.delays:
            spectra.append(-s[None] * self.torque(intrinsic, drive, s))
        return np.vstack(spectra)


class Point:
    """The equations at some parameters; weights and instruments are those of these parameters."""

    def __init__(self, equations: Equations, parameters: Parameters) -> None:
        linear = parameters.linear
        coefficients = linear[MOTION:]
        self.equations = equations
        self.parameters = parameters
        # Of all unknowns; those of basis functions have the same one.
        self.names = (*STIFFNESS, *["c"] * coefficients.size, *parameters.unknowns)
        self.reflex_path = ReflexPath(
            basis=equations.records[0].basis,
            coefficients=coefficients,
            dynamics=parameters.dynamics,
            passive=parameters.passive,
        )
        # Derivatives of the torque with respect to the unknowns, by the measured inputs and by the predicted ones, both
        # of shape (unknowns, frequencies).
        self.regressors = equations.differentiate(equations.measured, parameters)
        self.instruments = self.regressors
        if not equations.open_loop:
            self.instruments = equations.differentiate(equations.predicted, parameters)
        # Shape (frequencies,): measured torque less that of the model, its smoothed periodogram, and the noise that the
        # weights are the inverse of.
        torque = equations.select_recorded(equations.torque)
        self.residual = torque - linear @ self.regressors[: linear.size]
        self.noise = equations.smooth_power(self.residual)
        self.level = self.noise
        if equations.weighting == "flat":
            self.level = np.full(self.noise.size, self.noise.mean())
        self.weighted = self.instruments.conj() / self.level
        # Left side of the equations, zero at their solution; minus its slope for fixed weights and instruments; and
        # products of the instruments.
        self.side = np.real(self.weighted @ self.residual)
        self.normal = np.real(self.weighted @ self.regressors.T)
        self.information = np.real(self.weighted @ self.instruments.T)
        self.scatter = self.scatter_of(self.weighted)

    @property
    def values(self) -> dict[str, float]:
        """K, B, I, delay and the parameters of the reflex, by name."""
        stiffness = self.parameters.linear[:MOTION].tolist()
        delay = self.equations.delay + self.parameters.shift
        return {
            **dict(zip(STIFFNESS, stiffness, strict=True)),
            "delay": delay,
            **self.reflex_path.parameters,
        }

    @property
    def pole_out_of_band(self) -> bool:
        """Whether a pole of the second-order part is so fast that it cannot be told from a delay."""
        return self.parameters.dynamics.fastest_pole > self.equations.pole_limit

    def scatter_of(self, weighted: np.ndarray) -> np.ndarray:
        """Covariance of the products of weighted instruments with the noise, if nothing else is left.

        Each frequency counts twice.

        Shapes: weighted (rows, frequencies); returns (rows, rows).
        """
        products = np.real((weighted * self.noise) @ weighted.conj().T)
        return 0.5 * self.equations.band.correlation * products

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
        inverse = invert_scaled(self.normal[select])
        factor = 1.0 + 2.0 * self.equations.smoothing_variance
        return factor * inverse @ self.scatter[select] @ inverse.T

    @property
    def movement_p(self) -> float:
        """Probability of correlations of residual and movement at least as large, if the model were complete.

        The movement is what the instruments are made of: the predicted position, and the predicted drive of the
        reflex. In closed loop it does not depend on the noise, so that only a model that lacks something correlates
        the two. All are whitened. Lags within half a second are 1/(2b) apart in a band of width b; there the
        correlations of white signals are independent. The smaller one of the two probabilities counts, twice.
        """
        lags, square = self._movement_square
        return float(min(1.0, 2.0 * special.chdtrc(lags, square)))

    @property
    def movement_share(self) -> float:
        """Share of the residual that depends on the movement, beyond what chance would have."""
        lags, square = self._movement_square
        frequencies = self.residual.size / self.equations.band.correlation
        return float(max(0.0, 0.5 * (square - lags) / frequencies))

    @cached_property
    def _movement_square(self) -> tuple[int, float]:
        """Number of lags, and the larger sum of squared correlations of the residual with position or drive, a χ²."""
        band = self.equations.band
        part = band.parts[0]
        reach = int(MOVEMENT_REACH * 2 * part.bins.stop * part.rate / part.samples)
        predicted = self.equations.predicted
        drive = self.parameters.linear[MOTION:] @ predicted[MOTION:]
        residual = self.residual / np.sqrt(self.noise)
        squares = []
        for spectrum in (predicted[0], drive):
            if not spectrum.any():  # of an apparatus without friction
                continue
            power = band.smooth(np.abs(spectrum) ** 2, MOVEMENT_RESOLUTION)
            products = band.correlate(residual * spectrum.conj() / np.sqrt(power), reach)
            variance = 0.5 * self.equations.share * residual.size * band.correlation
            squares.append(np.sum(products**2) / variance)
        return 2 * reach + 1, max(squares)

    @cached_property
    def misfit(self) -> float:
        """Twice the negative log-likelihood of the torque less what the predicted inputs explain, but for a constant.

        With weights from the noise its spectrum is unknown (Whittle 1953), else it is white. In open loop its slope is
        the left side of the equations, but for the smoothing of weights.
        """
        equations = self.equations
        linear = self.parameters.linear
        torque = equations.select_recorded(equations.torque)
        remainder = torque - linear @ self.instruments[: linear.size]
        power = np.mean(np.abs(remainder) ** 2, keepdims=True)
        if equations.weighting == "noise":
            power = equations.smooth_power(remainder)
        return float(2.0 / equations.band.correlation * remainder.size * np.mean(np.log(power)))

    @cached_property
    def slope(self) -> np.ndarray:
        """Minus the slope of the left side, weights and instruments being renewed, shape (unknowns, unknowns)."""
        equations = self.equations
        slope = self.normal.copy()
        linear = self.parameters.linear.size
        target = self.residual / self.level
        for number, step in enumerate(SLOPE_STEP * np.eye(len(slope))[linear:], linear):
            ahead, behind = (
                equations.differentiate(equations.predicted, self.parameters.add(signed))
                for signed in (step, -step)
            )
            change = np.real((ahead - behind).conj() @ target) / (2.0 * SLOPE_STEP)
            # Instruments are the slopes of a torque, so their slopes are symmetric.
            slope[:, number] -= change
            slope[number, :linear] -= change[:linear]
        if equations.weighting == "noise":
            products = np.real(self.residual.conj() * self.regressors)
            noise_slopes = -2.0 * equations.smooth_rows(products)
            slope += np.real(self.weighted * self.residual) / self.level @ noise_slopes.T
        return slope


class Equations:
    """Spectra of the measured and of the predicted inputs of trials, and the equations between them.

    Several trials are one record whose frequencies lie side by side.
    """

    def __init__(
        self,
        trials: Sequence[PreparedTrial],
        records: Sequence[Regressors],
        weighting: str,
        highest: float = inf,  # frequency of the band [Hz], within the pass band
    ) -> None:
        self.records = records
        self.apparatus = trials[0].apparatus  # the same of all trials
        self.weighting = weighting  # "noise" or "flat"
        self.delay = records[0].delay  # of the inputs [s]
        # Shape (samples,): which of them no filled gap reaches, and their share.
        self.recorded = _join(
            [trial.recorded(record.grid) for trial, record in zip(trials, records, strict=True)]
        )
        self.share = float(self.recorded.mean())
        if self.share < LEAST_RECORDED:
            raise DataError(
                f"filled gaps of position and torque reach {100 - 100 * self.share:.3g} % of the record, and what is "
                "left says too little: record again."
            )
        sizes = [record.torque.size for record in records]
        self.band = pass_bands(sizes, records[0].rate, highest)
        # From this pole on none can be told from a delay [rad/s].
        self.pole_limit = FASTEST_POLE * self.band.highest
        # Variance of the smoothed spectrum over its square; zero for flat weights.
        self.smoothing_variance = 0.0
        if weighting == "noise":
            self.smoothing_variance = self.band.smoothing_variance(NOISE_RESOLUTION) / self.share
        self.torque = self.band.transform(_join([record.torque for record in records]))
        # Shape (3 + k, samples): the inputs over time.
        self.inputs = _join([record.inputs.T for record in records])
        self.measured = self.band.transform(self.inputs)
        self.predicted_inputs = _join([part.T for part in predict_inputs(trials, records)])
        self.predicted = self.band.transform(self.predicted_inputs)
        if self.apparatus is not None:
            pairs = zip(trials, records, strict=True)
            # Shape (4, samples).
            self.apparatus_inputs = _join([t.apparatus_inputs(r.grid).T for t, r in pairs])
        self.open_loop = records[0].reference_name == "position"
        references = [record.reference for record in records if record.reference is not None]
        self.reference = self.band.transform(_join(references))

    def select_recorded(self, spectra: np.ndarray) -> np.ndarray:
        """Spectra of signals that are zero where a filled gap reaches: the equations leave those samples out.

        Shapes: spectra (..., frequencies), as what is returned.
        """
        return spectra if self.share == 1.0 else self.band.weigh_samples(spectra, self.recorded)

    def smooth_power(self, spectrum: np.ndarray) -> np.ndarray:
        """Smoothed periodogram of what no gap reaches, shape (frequencies,)."""
        power = self.band.smooth(np.abs(spectrum) ** 2, NOISE_RESOLUTION) / self.share
        return np.maximum(power, POWER_FLOOR * power.max())

    def smooth_rows(self, rows: np.ndarray) -> np.ndarray:
        """Rows over frequency, smoothed as the periodogram is, shape (rows, frequencies)."""
        return np.array([self.band.smooth(row, NOISE_RESOLUTION) for row in rows]) / self.share

    def differentiate(self, spectra: np.ndarray, parameters: Parameters) -> np.ndarray:
        """Derivatives of the torque with respect to the parameters, by some inputs, shape (unknowns, frequencies)."""
        rows = parameters.differentiate(spectra[:MOTION], spectra[MOTION:], self.band.s)
        return self.select_recorded(rows)

    def hold_at_limits(self, parameters: Parameters) -> tuple[Parameters, set[str]]:
        """Parameters without a third pole or a delay beyond their limits, and the names of those that were."""
        limited = parameters.limit_delay(self.delay)
        names = set()
        if limited.shift != parameters.shift:
            names.add("delay")
        if (parameters.dynamics.pole or 0.0) >= self.pole_limit:
            no_pole = replace(limited.dynamics, pole=NO_POLE * self.pole_limit)
            limited = replace(limited, dynamics=no_pole)
            names.add("pole")
        return limited, names

    def find_start(self, order: int, *, estimate_delay: bool) -> Parameters:
        """Best of a grid of dynamics for the predicted position, a fit to the torque that it explains."""
        start_delay = self.delay if estimate_delay else None
        shifts, responses, delays = make_grid(self.band, order, start_delay)
        noise = np.ones(self.torque.size)
        for _ in range(2 if self.weighting == "noise" else 1):
            linear, best, residual = fit_grid(self.predicted, self.torque, responses, delays, noise)
            noise = self.smooth_power(residual)
        number, late = divmod(best, shifts.size)
        return Parameters(
            linear=linear,
            dynamics=GRIDS[order][number],
            shift=float(shifts[late]),
            delays=("delay",) if estimate_delay else (),
        )


def describe_lost_pole(order: int) -> str:
    """Warning about dynamics of the reflex one of whose poles cannot be told from a delay."""
    remedy = "take order=2" if order == 3 else "its gain or the record is too small for two"
    return f"a pole of the reflex has left the band, so the record does not show {order}: {remedy}."


def _join(parts: Sequence[np.ndarray]) -> np.ndarray:
    """Signals of records, one after the other."""
    return parts[0] if len(parts) == 1 else np.concatenate(parts, axis=-1)
