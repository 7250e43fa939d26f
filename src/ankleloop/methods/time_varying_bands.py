"""Covariance of the parameters of `riv-tv`, bands, alternatives, and the test whether anything varies at all."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.fft import irfft
from scipy import special

from ankleloop.methods.riv_alternatives import Alternative, compute_shifts
from ankleloop.methods.riv_equations import solve_scaled
from ankleloop.methods.time_varying_equations import WhitenedSystem
from ankleloop.methods.time_varying_search import TimeVaryingSolution

PARAMETERS = ("K", "B", "G")
INTEGRATION = 2001  # places at which squares of splines are summed
EFFECTS = ("lag", "high-pass", "friction", "compression", "direction", "delay")


@dataclass(frozen=True, eq=False)
class TimeVaryingCovariance:
    """Covariance of all unknowns, and half of a 95 % interval over its standard error."""

    matrix: np.ndarray  # shape (unknowns, unknowns): the covariance
    quantile: float  # quantile of Student's distribution

    def margin(self, weights: np.ndarray, places: slice | int) -> np.ndarray:
        """Half of the 95 % interval of sums of some unknowns, shape (sums,).

        Shapes: weights (sums, unknowns in `places`).
        """
        block = np.atleast_2d(self.matrix[places, places])
        return self.quantile * np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", weights, block, weights), 0.0))


@dataclass(frozen=True, eq=False)
class Trajectory:
    """A parameter over what it varies with."""

    values: np.ndarray  # shape (places,): the parameter; nan where the record does not show it
    low: np.ndarray  # shape (places,): lower end of its band
    high: np.ndarray  # shape (places,): upper end of its band
    # Shape (places,): information of the record about the parameter at each place, over its mean.
    excitation: np.ndarray


def covariance(solution: TimeVaryingSolution) -> TimeVaryingCovariance:
    r"""Covariance of the unknowns about the true ones, smoothing included.

    .. math:: A^{-1} (M + s^2 S_\lambda) A^{-T}, \quad A = Z^T X + S_\lambda,

    with M the sum over cycles of the outer products of their contributions to the left side of the equations, which
    holds whatever the noise does within a cycle; the second term is what the penalties may have smoothed away, for
    trajectories as rough as they say (Nychka 1988). Weights from the noise are estimates themselves
    (`ankleloop.methods.riv_covariance.asymptotic_covariance`).

    References
    ----------
    D. Nychka, "Bayesian confidence intervals for smoothing splines", Journal of the American Statistical Association
    83(404), 1134-1143, 1988.
    """
    e, system = solution.equations, solution.system
    course, size = e.inputs.course, e.bases.size
    residual = system.residual(solution.parameters.linear)
    starts = np.searchsorted(course.segment, np.arange(course.segments))
    scores = np.add.reduceat(system.instruments * residual, starts, axis=1)
    middle = scores @ scores.T
    middle[:size, :size] += solution.variance * e.bases.penalty(solution.penalties)
    half = solve_scaled(solution.matrix, middle)
    matrix = solve_scaled(solution.matrix, half.T)
    factor = (1.0 + 2.0 * e.smoothing_variance) * course.segments / (course.segments - 1.0)
    return TimeVaryingCovariance(factor * 0.5 * (matrix + matrix.T), float(special.stdtrit(course.segments - 1, 0.975)))


def excitation(solution: TimeVaryingSolution) -> list[np.ndarray]:
    """Information of the record about the splines of K, B, G and I, over its mean, for splines of equal size.

    Shapes: returns (splines,).
    """
    information, bases = np.diag(solution.system.information), solution.equations.bases
    grid = np.linspace(0.0, 1.0, INTEGRATION)
    maps = []
    for splines, block in zip(bases.all, bases.blocks, strict=True):
        density = information[block] / np.mean(splines(grid) ** 2, axis=0)
        maps.append(density / max(float(np.mean(density)), np.finfo(float).tiny))
    return maps


def trajectory(
    solution: TimeVaryingSolution, covariance: TimeVaryingCovariance, number: int, places: np.ndarray, least: float
) -> Trajectory:
    """Trajectory of K, B, G or I with its band.

    Shapes: places (places,).
    """
    bases = solution.equations.bases
    splines, block = bases.all[number], bases.blocks[number]
    weights = splines(places)
    values, margin = weights @ solution.parameters.linear[block], covariance.margin(weights, block)
    shown = weights @ excitation(solution)[number]
    blank = np.where(shown < least, np.nan, 0.0)
    return Trajectory(values + blank, values - margin + blank, values + margin + blank, shown)


def variation_p(solution: TimeVaryingSolution) -> dict[str, float]:
    """Probability of a variation at least as large as the one that was seen, if K, B and G were constant.

    A score test: the equations are solved for constant parameters, with the weights and the dynamics of the solution,
    and the left sides of those for the contrasts of the splines are compared with their covariance, which the spectrum
    of the residual gives.
    """
    bases, unknowns = solution.equations.bases, len(solution.system.normal)
    contrasts, constants = [], []
    blocks = bases.blocks[: len(PARAMETERS)]
    for splines, block in zip(bases.all, blocks, strict=False):
        matrix = np.zeros((unknowns, splines.size))
        matrix[block] = np.linalg.svd(np.ones((1, splines.size)))[2].T
        constants.append(matrix[:, :1])
        contrasts.append(matrix[:, 1:])
    others = np.delete(np.eye(unknowns), np.r_[blocks], axis=1)
    base = np.hstack([*constants, others])
    values, scatter = {}, _side_covariance(solution)
    for k, name in enumerate(PARAMETERS):
        free = [base, *(contrast for j, contrast in enumerate(contrasts) if j != k)]
        values[name] = _score_p(solution, scatter, np.hstack(free), contrasts[k])
    values["all"] = _score_p(solution, scatter, base, np.hstack(contrasts))
    return values


def _score_p(solution: TimeVaryingSolution, scatter: np.ndarray, free: np.ndarray, tested: np.ndarray) -> float:
    """Probability of left sides of tested directions as large as they are, the free ones being solved for."""
    system = solution.system
    normal = system.normal
    projection = np.eye(len(normal)) - normal @ free @ solve_scaled(free.T @ normal @ free, free.T)
    rows = tested.T @ projection
    side = rows @ system.side
    statistic = float(side @ solve_scaled(rows @ scatter @ rows.T, side))
    return float(special.chdtrc(tested.shape[1], statistic))


def _side_covariance(solution: TimeVaryingSolution) -> np.ndarray:
    """Covariance of the left sides of the equations, for noise of the spectrum of the residual."""
    e, system = solution.equations, solution.system
    coloured = e.colour(system.instruments, system.residual(solution.parameters.linear))
    # The spectrum is an estimate, by which left sides scatter more.
    return solution.variance * (1.0 + e.band.smoothing_variance(e.resolution)) * (coloured @ coloured.T)


def find_time_varying_alternatives(solution: TimeVaryingSolution) -> list[Alternative]:
    """Effects with their scores, and how far the means of K, B, I and G move with one step towards each of them."""
    e, system, linear = solution.equations, solution.system, solution.parameters.linear
    residual, inverse = system.residual(linear), solve_scaled(solution.matrix, np.eye(len(system.normal)))
    noise = e.noise(solution.parameters)
    weight = e.weight(noise)
    whiten = e.whitener(weight, e.level(noise, weight))
    scale = np.sqrt(solution.variance * (1.0 + e.smoothing_variance))
    alternatives = []
    estimated = {"delay": e.estimate_delay, "lag": e.estimate_lag}
    for effect in (name for name in EFFECTS if not estimated.get(name)):
        regressor, instrument = (whiten(row[None])[0] for row in _rows(effect, solution))
        instrument = instrument - (instrument @ system.regressors.T) @ inverse @ system.instruments
        side = instrument @ residual
        score = side / (scale * np.linalg.norm(e.colour(instrument[None], residual)))
        step = side / (instrument @ regressor)
        moved = -step * (inverse @ (system.instruments @ regressor))
        shifts = compute_shifts(e.means(linear), e.means(linear + moved[: linear.size]))
        value = e.delay + solution.parameters.shift + step if effect == "delay" else step
        alternatives.append(Alternative(effect, float(value), float(score), shifts))
    return alternatives


def _rows(effect: str, solution: TimeVaryingSolution) -> tuple[np.ndarray, np.ndarray]:
    """Spectra of the derivatives of the torque with respect to an effect, by measured and by predicted inputs."""
    e, parameters = solution.equations, solution.parameters
    inputs, s = e.inputs, np.where(e.inside, e.inputs.s, 1.0)
    response = e.responses(parameters)[0]
    gain, motion = parameters.linear[e.bases.blocks[2]], parameters.linear[: len(e.motion)]
    predicted = motion @ e.predicted_motion + response * (gain @ e.predicted_drive)
    torque = e.lead(parameters)
    if effect == "lag":
        return -s * torque, -s * predicted
    if effect == "high-pass":
        return -torque / s, -predicted / s
    if effect == "compression":
        signals = (irfft(spectrum, inputs.size)[: inputs.grid.samples] for spectrum in (torque, predicted))
        first, second = (inputs.spectra(-(signal[None] ** 3))[0] for signal in signals)
        return first, second
    if effect == "delay":
        return -s * response * (gain @ e.drive), -s * response * (gain @ e.predicted_drive)
    velocities = inputs.motion[1], (inputs.motion if inputs.own_instruments else inputs.predicted_motion)[1]
    if effect == "friction":
        return inputs.spectra(np.sign(velocities[0])[None])[0], inputs.spectra(np.sign(velocities[1])[None])[0]
    drives = inputs.drive(e.delay), (inputs.drive if inputs.own_instruments else inputs.predicted_drive)(e.delay)
    late = np.exp(-inputs.s * e.delay)
    first, second = (
        response * (inputs.spectra(drive[None])[0] - late * inputs.spectra(velocity[None])[0])
        for drive, velocity in zip(drives, velocities, strict=True)
    )
    return first, second


def instrument_strength(system: WhitenedSystem, size: int) -> float:
    """Smallest canonical correlation of instruments and regressors of the linear parameters."""
    if system.instruments is system.regressors:
        return 1.0
    x = system.regressors[:size]
    measured, predicted, cross = x @ x.T, system.information[:size, :size], system.normal[:size, :size]
    try:
        left, right = np.linalg.cholesky(predicted), np.linalg.cholesky(measured)
    except np.linalg.LinAlgError:
        return 0.0
    matrix = np.linalg.solve(right, np.linalg.solve(left, cross).T)
    return float(np.linalg.svd(matrix, compute_uv=False)[-1])
