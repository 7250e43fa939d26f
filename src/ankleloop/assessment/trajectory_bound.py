"""The Cramér-Rao bound of trajectories: the smallest deviation of K, B and G that change in a simulated experiment."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from ankleloop.arguments import check_flag, check_number
from ankleloop.assessment.cramer_rao import SingularInformation, disturbance_spectrum, invert_information
from ankleloop.assessment.trajectory_scores import TRAJECTORY_TRUTHS
from ankleloop.errors import DataError
from ankleloop.joint.dynamics import ReflexDynamics
from ankleloop.joint.prepared import PreparedTrial, prepare
from ankleloop.joint.time_varying_course import Course, make_course
from ankleloop.joint.time_varying_trajectories import Splines
from ankleloop.methods.riv_covariance import LOGARITHMIC
from ankleloop.methods.riv_tv import PLACES, RivTvOptions
from ankleloop.methods.time_varying_equations import Bases, TimeVaryingEquations, TimeVaryingParameters
from ankleloop.methods.time_varying_inputs import TimeVaryingInputs
from ankleloop.quantities import QUANTITIES
from ankleloop.simulation.settings import SimulationSettings
from ankleloop.simulation.simulate import simulate

COURSES = {"cycle": ("phase", None), "time": (None, None), "schedule": (None, "schedule")}
UNDISTURBED = {"snr_db": None, "voluntary": 0.0}


@dataclass(frozen=True, eq=False)
class TrajectoryInformation:
    """Fisher information of a record about splines of K, B and G, the inertia, the dynamics and the delay."""

    matrix: np.ndarray  # shape (unknowns, unknowns): the information, in inverse squares of the units of the unknowns
    bases: Bases  # splines of K and B, whose coefficients come first; then the inertia; then the splines of G
    names: tuple[str, ...]  # the unknowns behind those: logarithms of the dynamics of the reflex, and the delay [s]
    course: Course  # what K, B and G vary with
    dynamics: ReflexDynamics  # the true dynamics

    def covariance(self) -> np.ndarray:
        """Smallest covariance of the unknowns; infinite variances where the record has no information."""
        try:
            return invert_information(self.matrix)
        except SingularInformation:
            raise DataError(
                "the record does not tell the splines apart: their information is singular. Use a longer record, a "
                "richer perturbation, or fewer knots."
            ) from None


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

    Examples
    --------
    >>> bound = trajectory_bound(seed=1, variation="cycle", duration=42.0, stiffness_variation=0.4)
    >>> bound["K"].dims, bool(bound["K_mean"] < bound["K"].min())
    (('phase',), True)
    """
    information = trajectory_information(
        seed=seed, knots=knots, identification_rate=identification_rate, known_delay=known_delay, **settings
    )
    covariance, bases, course = information.covariance(), information.bases, information.course
    places = np.linspace(0.0, 1.0, PLACES)
    low, high = course.limits
    bound = xr.Dataset(coords={course.dimension: low + (high - low) * places})
    for name, splines, block in zip("KBG", bases.all, bases.blocks, strict=False):
        weights = splines(places)
        variance = np.einsum("ij,jk,ik->i", weights, covariance[block, block], weights)
        bound[name] = course.dimension, np.sqrt(variance)
        mean = weights[:-1].mean(axis=0)
        bound[f"{name}_mean"] = np.sqrt(mean @ covariance[block, block] @ mean)
    deviations = np.sqrt(np.diag(covariance))
    bound["I"] = deviations[bases.blocks[3].start]
    for name, deviation in zip(information.names, deviations[bases.size :], strict=True):
        bound[name] = deviation * (information.dynamics.values[name] if name in LOGARITHMIC else 1.0)
    for variable, values in bound.data_vars.items():
        quantity = QUANTITIES[str(variable).removesuffix("_mean")]
        values.attrs = {"units": quantity.unit, "long_name": f"smallest standard deviation of the {quantity.name}"}
    return bound


def trajectory_information(
    *,
    seed: int | np.random.SeedSequence,
    knots: Sequence[int],
    identification_rate: float = 100.0,
    known_delay: bool = True,
    **settings: Any,
) -> TrajectoryInformation:
    """Information of one trial, whose inverse gives the variances of `trajectory_bound`."""
    rate = check_number("trajectory_bound", "identification_rate", identification_rate, "Hz", ge=1, le=10000)
    check_flag("trajectory_bound", "known_delay", known_delay)
    counts = RivTvOptions.parse("trajectory_bound", knots=knots).knots
    values = SimulationSettings.parse("trajectory_bound", **settings)
    _check_settings(values)
    clean = prepare(simulate(seed=seed, **{**dict(values), **UNDISTURBED}))
    grid = clean.grid(rate, values.delay)
    assert values.variation is not None
    course = make_course(clean, grid, *COURSES[values.variation])
    bases = Bases(*(Splines(count, course.periodic) for count in counts))
    equations = TimeVaryingEquations(
        TimeVaryingInputs(clean, grid, course, "position"),
        bases,
        values.delay,
        order=2 if values.pole is None else 3,
        estimate_delay=not known_delay,
        torque_lag=0.0,
        weighting="noise",
    )
    dynamics = ReflexDynamics(values.omega_n, values.zeta, values.pole)
    parameters = TimeVaryingParameters(_true_coefficients(clean, equations), dynamics)
    # White noise has the variance of a density up to half of the rate.
    variance = 0.5 * equations.inputs.rate * _density(equations, _level(seed, values, clean), values)
    weight = np.where(equations.inside, 1.0 / np.sqrt(variance), 0.0)
    system = equations.system(parameters, weight, np.ones(equations.rows.stop - equations.rows.start))
    return TrajectoryInformation(system.information, bases, equations.names, course, dynamics)


def _check_settings(settings: SimulationSettings) -> None:
    if settings.variation is None:
        raise ValueError(
            "trajectory_bound: variation must be 'cycle', 'time' or 'schedule', got None: the bound of a constant "
            "joint is that of cramer_rao."
        )
    if settings.reflex_threshold != 0:
        raise ValueError(
            "the bound is derived for a rectifier at zero velocity: reflex_threshold must be 0, got "
            f"{settings.reflex_threshold:g}."
        )
    if settings.snr_db is None and settings.voluntary == 0:
        raise ValueError("without a disturbance the bound is 0: set snr_db or voluntary.")


def _true_coefficients(trial: PreparedTrial, equations: TimeVaryingEquations) -> np.ndarray:
    """Splines that are closest to the true K, B and G, and no inertia, of which nothing else depends."""
    course, bases, grid = equations.inputs.course, equations.bases, equations.inputs.grid
    linear = np.zeros(bases.size)
    for name, splines, block in zip(TRAJECTORY_TRUTHS.values(), bases.all, bases.blocks, strict=False):
        truth = trial.channel(name, grid)[course.rows]
        linear[block] = np.linalg.lstsq(splines(course.place[course.rows]), truth, rcond=1e-12)[0]
    return linear


def _level(seed: int | np.random.SeedSequence, settings: SimulationSettings, clean: PreparedTrial) -> float:
    """Standard deviation of the torque that the perturbation alone causes, the unit of the disturbances [N·m]."""
    if settings.movement > 0 or settings.locked_torque > 0:
        still = {**dict(settings), **UNDISTURBED, "movement": 0.0, "locked_torque": 0.0}
        return float(np.std(simulate(seed=seed, **still)["torque"].values))
    return float(np.std(clean.samples("torque")))


def _density(equations: TimeVaryingEquations, level: float, settings: SimulationSettings) -> np.ndarray:
    """Density of the disturbances at the frequencies of the equations [(N·m)²/Hz]; 1 beyond those that count."""
    density = np.ones(equations.frequency.size)
    density[equations.inside] = disturbance_spectrum(equations.frequency[equations.inside], level, settings)
    return density
