"""Refined instrumental variables for joints that change in time: K, B and G over a cycle, over time, or a schedule."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Literal, Self

import numpy as np
from pydantic import field_validator, model_validator

from ankleloop.joint.estimate import Estimate
from ankleloop.joint.hammerstein import fit_basis
from ankleloop.joint.models import ModelInputs, TimeVaryingModel
from ankleloop.joint.prepared import PreparedTrial
from ankleloop.joint.time_varying_course import Splines, describe_schedule, make_course, trajectory_dataset
from ankleloop.methods.method import NOMINAL_DELAY, Method, delay_option, rate_option, rectifier_option
from ankleloop.methods.riv.alternatives import add_alternatives, compute_shifts
from ankleloop.methods.riv.covariance import estimate_intervals
from ankleloop.methods.riv.equations import DELAY_LIMITS
from ankleloop.methods.riv_tv.equations import CONSTANT, Bases, TimeVaryingEquations
from ankleloop.methods.riv_tv.inputs import TimeVaryingInputs, check_course, check_perturbation
from ankleloop.methods.riv_tv.solution import TimeVaryingSolution, solve_time_varying
from ankleloop.options import Options, as_plain, option, show_value

PLACES = 101  # of a trajectory
FEW_CYCLES = 20  # below which bands are too narrow
WEAK = 10.0  # statistic of weak instruments (Staiger and Stock 1997)


class RivTvOptions(Options):
    """Options of refined instrumental variables for joints that change in time."""

    cycle_onsets: tuple[float, ...] | str | None = option(
        None,
        "start of every cycle, the last one ending the last cycle; or the variable of the trial that holds the phase "
        "of the cycle, from 0 to 1",
        unit="s",
    )
    schedule: str | None = option(
        None, "scheduling variable of the trial: K, B and G are functions of it; null without cycles: of time"
    )
    knots: tuple[int, int, int] = option((12, 8, 12), "numbers of splines of K, B and G; penalties smooth them")
    inertia_knots: int = option(
        1, "number of splines of I, of a posture or a limb that changes; 1 for a constant", ge=1, le=200
    )
    interpolation: Literal["cubic", "constant"] = option(
        "cubic", "cubic splines; or values that are constant over equal intervals, as of short segments"
    )
    order: Literal[2, 3] = option(2, "poles of the reflex dynamics (Eq. 2)")
    delay: float | None = delay_option(estimated=True)
    basis: Literal["rectifier"] | None = rectifier_option()
    torque_lag: float | None = option(
        0.0, "lag of the torque channel behind the position; null estimates it", unit="s", ge=-0.05, le=0.05
    )
    rest_position: float | None = option(
        None,
        "position at which the elastic torque is zero: what K varies times the distance from it repeats with the "
        "cycle, and no record tells it from other torque that does; null: the mean position",
        unit="rad",
        ge=-10,
        le=10,
    )
    identification_rate: float = rate_option()
    reference: str = option(
        "reference",
        'variable of the trial that the load cannot reach: the command of the servo, or "position" in open loop, which '
        "is least squares",
    )
    weighting: Literal["noise", "flat"] = option(
        "noise", "weights of frequencies and of phases: the inverse of the noise, or flat"
    )

    @field_validator("cycle_onsets", mode="before")
    @classmethod
    def _as_onsets(cls, values: Any) -> Any:
        """Onsets come as lists from YAML, and as arrays from NumPy."""
        if values is None or isinstance(values, str):
            return values
        numbers = _as_tuple(values)
        if numbers is None:
            raise ValueError(
                "cycle_onsets must be times in seconds, or the name of the variable that holds the phase; got "
                f"{show_value(values)}."
            )
        for number, value in enumerate(numbers, 1):
            if not isinstance(value, (int, float)) or not np.isfinite(value):
                raise ValueError(
                    f"cycle_onsets must be finite times in seconds; onset {number} of {len(numbers)} is "
                    f"{show_value(value)}."
                )
        return numbers

    @field_validator("knots", mode="before")
    @classmethod
    def _as_knots(cls, values: Any) -> Any:
        """Knots come as lists from YAML, and as arrays from NumPy."""
        numbers = _as_tuple(values)
        if numbers is None or len(numbers) != len("KBG"):
            raise ValueError(f"knots must be three whole numbers, those of K, B and G; got {show_value(values)}.")
        return tuple(int(value) if type(value) is float and value.is_integer() else value for value in numbers)

    @model_validator(mode="after")
    def _check_knots(self) -> Self:
        least = 4 if self.interpolation == "cubic" else 1
        for name, count in zip("KBG", self.knots, strict=True):
            if not least <= count <= 200:
                raise ValueError(f"knots must be between {least} and 200 for {name}, got {count}.")
        if 1 < self.inertia_knots < least:
            raise ValueError(f"inertia_knots must be 1, or between {least} and 200, got {self.inertia_knots}.")
        if self.cycle_onsets is not None and self.schedule is not None:
            raise ValueError("cycle_onsets and schedule exclude each other: K, B and G are functions of one of them.")
        return self


def _as_tuple(values: Any) -> tuple[Any, ...] | None:
    """Values of a list, tuple or array; None for anything else."""
    values = values if isinstance(values, (list, tuple)) else np.asarray(values).tolist()
    return tuple(map(as_plain, values)) if isinstance(values, (list, tuple)) else None


def identify_riv_tv(trial: PreparedTrial, options: RivTvOptions) -> Estimate:
    r"""Estimate K, B and G as functions of phase, time or a scheduling variable, consistent in closed loop.

    The model is

    .. math:: TQ = K(\tau) P + B(\tau) \dot P + I \ddot P + H\{G(\tau)\, \max(0, \dot P(t - d))\} + e(\tau) + v

    with a low-pass H of unit gain, a torque e that repeats with the cycle (or changes slowly), and v of any spectrum:
    voluntary torque and noise, which the load feeds back to P. K, B and G are cubic splines of τ, with penalties on
    their roughness whose weights restricted likelihood chooses. The instruments are the same regressors made of the
    position that movement and reference explain. What repeats with the cycle is taken out of torque, regressors and
    instruments. Frequencies are weighted by the inverse of the noise spectrum, and places by that of its level.

    Parameters
    ----------
    trial : PreparedTrial
    options : RivTvOptions

    Returns
    -------
    Estimate
        `trajectories` holds K, B and G, and I where `inertia_knots` says so, with their 95 % bands; `stiffness`
        and `reflex` their means over the record, and I, ωn, ζ, delay. `diagnostics`: rounds, converged, cycles
        (or segments that count as independent), intervals (their kind), variation_p (probability of a variation
        as large, were K, B or G constant), instrument_strength (smallest canonical correlation of instruments
        and regressors), outside (share of the samples whose scheduling variable lies beyond its fitted range,
        the 2nd to the 98th percentile; they count as its ends), freedom (effective number of parameters of each
        trajectory), excitation (information about each over its mean, at the places of the trajectories),
        torque_lag, and alternatives as of `ankleloop.methods.riv.riv.identify_riv`.

    References
    ----------
    D. L. Guarin, R. E. Kearney, "Estimation of time-varying, intrinsic and reflex dynamic joint stiffness during
    movement", Frontiers in Computational Neuroscience 11, 51, 2017. S. N. Wood, M. Fasiolo, "A generalized
    Fellner-Schall method for smoothing parameter optimization", Biometrics 73(4), 1071-1081, 2017. D. Staiger,
    J. H. Stock, "Instrumental variables regression with weak instruments", Econometrica 65(3), 557-586, 1997.

    Examples
    --------
    >>> from ankleloop.methods.registry import identify
    >>> from ankleloop.simulation.simulate import simulate
    >>> trial = simulate(seed=1, duration=30.0, variation="cycle", stiffness_variation=0.4)
    >>> estimate = identify(trial, "riv-tv", cycle_onsets="phase")
    >>> bool(abs(float(estimate.trajectories["K"].sel(phase=0.5)) - 210.0) < 30.0)
    True
    """
    solution = _solve(trial, options)
    estimate = _estimate(trial, solution, options)
    if not solution.converged:
        return estimate
    alternatives = solution.find_alternatives()
    if alternatives[-1].effect == "delay" and alternatives[-1].significant:  # one step is too short for a delay
        freed = _solve(trial, options.model_copy(update={"delay": None}))
        shifts = compute_shifts(solution.means, freed.means)
        alternatives[-1] = replace(alternatives[-1], value=freed.delay, shifts=shifts)
    return add_alternatives(estimate, alternatives)


def _solve(trial: PreparedTrial, options: RivTvOptions) -> TimeVaryingSolution:
    trial.check_reference(options.reference)
    delay = NOMINAL_DELAY if options.delay is None else options.delay
    grid = trial.grid(options.identification_rate, DELAY_LIMITS[1] if options.delay is None else delay)
    course = make_course(trial, grid, options.cycle_onsets, options.schedule)
    degree = 3 if options.interpolation == "cubic" else 0
    counts = *options.knots, options.inertia_knots
    k, b, g, i = (CONSTANT if count == 1 else Splines(count, course.periodic, degree) for count in counts)
    inputs = TimeVaryingInputs(trial, grid, course, options.reference)
    check_perturbation(inputs)
    equations = TimeVaryingEquations(inputs, Bases((k, b, g, i)), delay, options.weighting)
    unknowns = ("delay",) * (options.delay is None) + ("torque_lag",) * (options.torque_lag is None)
    return solve_time_varying(equations, options.order, unknowns, options.torque_lag or 0.0)


def _estimate(trial: PreparedTrial, solution: TimeVaryingSolution, options: RivTvOptions) -> Estimate:
    """Torques, trajectories with their bands, and means over the record."""
    equations, inputs, parameters = solution.equations, solution.equations.inputs, solution.parameters
    bases, course = equations.bases, inputs.course
    places = np.linspace(0.0, 1.0, PLACES)
    curves, excitation = solution.find_trajectories(places)
    schedule = describe_schedule(trial.trial, options.schedule)
    coordinate = course.limits[0] + (course.limits[1] - course.limits[0]) * places
    delay, dynamics, means = solution.delay, parameters.dynamics, solution.means
    stiffness, viscosity, gain, inertia = (parameters.linear[block] for block in bases.blocks)
    model = TimeVaryingModel(
        ModelInputs(fit_basis(trial.velocity(delay), "rectifier", 1), delay, inputs.rate, trial.rate),
        course.dimension,
        options.schedule or (options.cycle_onsets if isinstance(options.cycle_onsets, str) else None),
        np.array(course.limits),
        bases.all[0].degree,
        stiffness,
        viscosity,
        gain,
        inertia,
        dynamics,
        parameters.lag,
        options.rest_position,
    )
    reflex = {"delay": delay, "G": means.pop("G"), **dynamics.values}
    intervals = estimate_intervals(means | reflex, solution.deviations, solution.quantile)[1]
    return Estimate(
        method="riv-tv",
        torque=model.simulate(trial, inputs.grid, course.place),
        matrices=None,
        stiffness=means,
        reflex=reflex,
        intervals=intervals if solution.converged else {},
        diagnostics={
            "order": options.order,
            "rounds": solution.rounds,
            "converged": solution.converged,
            "cycles" if course.periodic else "segments": course.segments,
            "intervals": "robust" if solution.converged else None,
            "variation_p": solution.variation_p,
            "instrument_strength": solution.strength,
            "outside": course.outside,
            "freedom": solution.freedom,
            "excitation": excitation,
            "torque_lag": parameters.lag,
            "reference": options.reference,
            "warnings": _warnings(solution, coordinate, curves),
        },
        predictor=model,
        trajectories=trajectory_dataset(course.dimension, coordinate, curves, **schedule),
    )


def _warnings(solution: TimeVaryingSolution, coordinate: np.ndarray, curves: dict[str, np.ndarray]) -> list[str]:
    """What the record does not show, or the search did not reach."""
    equations, course, strength = solution.equations, solution.equations.inputs.course, solution.strength
    warnings = check_course(equations.inputs)
    if course.periodic and course.segments < FEW_CYCLES:
        warnings.append(f"{course.segments} cycles are few: the bands are too narrow below about {FEW_CYCLES}.")
    for name in equations.bases.names:
        blank = np.isnan(curves[name])
        edges = np.flatnonzero(np.diff(blank, prepend=False, append=False))
        ranges = [f"{coordinate[start]:.3g} to {coordinate[stop - 1]:.3g}" for start, stop in edges.reshape(-1, 2)]
        if ranges:
            warnings.append(
                f"{name} is not identified at {course.dimension} {', '.join(ranges)}: the perturbation hardly excites "
                "the joint there."
            )
    # The F statistic of the direction that the instruments explain least, which weak instruments have below 10.
    independent = solution.system.torque.size * equations.share / equations.bases.size - 1.0
    if strength**2 / max(1.0 - strength**2, 1e-12) * independent < WEAK:
        warnings.append(
            f"the instruments are weak: their smallest canonical correlation with the regressors is {strength:.2g}. "
            "Record more cycles, perturb more strongly, or take fewer knots."
        )
    if not solution.converged:
        warnings.append(f"not converged after {solution.rounds} rounds: the trajectories have no bands.")
    return warnings


METHODS = (Method("riv-tv", RivTvOptions, identify_riv_tv),)
