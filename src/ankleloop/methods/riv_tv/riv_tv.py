"""Refined instrumental variables for joints that change in time: K, B and G over a cycle, over time, or a schedule."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import xarray as xr

from ankleloop.checks.course import check_slow_movement, refuse_locked_perturbation
from ankleloop.joint.estimate import Estimate
from ankleloop.joint.hammerstein import fit_basis
from ankleloop.joint.models import ModelInputs, TimeVaryingModel
from ankleloop.joint.prepared import PreparedTrial
from ankleloop.joint.time_varying_course import trajectory_dataset
from ankleloop.methods.method import Method
from ankleloop.methods.riv.alternatives import (
    Alternative,
    compute_shifts,
    describe_alternatives,
    select_alternatives,
    warn_of_alternatives,
    widen_intervals,
)
from ankleloop.methods.riv.riv import estimate_intervals
from ankleloop.methods.riv_tv.alternatives import find_alternatives
from ankleloop.methods.riv_tv.equations import TimeVaryingEquations
from ankleloop.methods.riv_tv.options import RivTvOptions
from ankleloop.methods.riv_tv.solution import (
    TimeVaryingSolution,
    Trajectory,
    solve_time_varying,
)
from ankleloop.quantities import STIFFNESS

PLACES = 101  # of a trajectory
FEW_CYCLES = 20  # below which bands are too narrow
WEAK = 10.0  # F statistic of weak instruments (Staiger and Stock 1997)


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
        and `reflex` their means over the record, and I, ωn, ζ, delay. `diagnostics`: converged, cycles
        (or segments that count as independent), intervals (their kind), variation_p (probability of a variation
        as large, were K, B or G constant), excitation (information about each trajectory over its mean, at its
        places), torque_lag, and alternatives as of `ankleloop.methods.riv.riv.identify_riv`.

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
    alternatives: list[Alternative] = []
    if solution.converged:
        alternatives = select_alternatives(_list_alternatives(trial, solution, options))
    return _estimate(trial, solution, options, alternatives)


def _solve(trial: PreparedTrial, options: RivTvOptions) -> TimeVaryingSolution:
    """Solution of the equations of a trial, whose perturbation must not repeat with the cycle."""
    trial.check_variable(options.reference)
    equations = TimeVaryingEquations(trial, options)
    if equations.course.periodic:
        smooth_part = equations.smooth_part
        refuse_locked_perturbation(
            smooth_part.deviation(trial.channel(options.reference, equations.grid)),
            equations.course,
            smooth_part.part,
            options.reference,
        )
    return solve_time_varying(equations)


def _list_alternatives(
    trial: PreparedTrial, solution: TimeVaryingSolution, options: RivTvOptions
) -> list[Alternative]:
    """What the model may lack; one step is too short for a delay, so the equations are solved for it."""
    alternatives = []
    for alternative in find_alternatives(solution):
        if alternative.effect == "delay" and alternative.significant:
            freed = _solve(trial, options.model_copy(update={"delay": None}))
            shifts = compute_shifts(solution.means, freed.means)
            alternative = replace(alternative, value=freed.delay, shifts=shifts)
        alternatives.append(alternative)
    return alternatives


def _estimate(
    trial: PreparedTrial,
    solution: TimeVaryingSolution,
    options: RivTvOptions,
    alternatives: list[Alternative],
) -> Estimate:
    """Torques, trajectories with their bands, and means over the record."""
    equations = solution.equations
    course = equations.course
    parameters = solution.parameters
    trajectories = solution.find_trajectories(np.linspace(0.0, 1.0, PLACES))
    coordinate = np.linspace(*course.limits, PLACES)
    model = _make_model(trial, solution, options)
    means = solution.means
    values = {**means, "delay": solution.delay, **parameters.dynamics.values}
    intervals: dict[str, tuple[float, float]] = {}
    if solution.converged:
        intervals = estimate_intervals(values, solution.deviations, solution.quantile)[1]
    return Estimate(
        method="riv-tv",
        torque=model.torques(trial, equations.grid, course.place),
        stiffness={name: means[name] for name in STIFFNESS},
        reflex={"delay": solution.delay, "G": means["G"], **parameters.dynamics.values},
        intervals=widen_intervals(intervals, values, alternatives),
        diagnostics={
            "order": options.order,
            "converged": solution.converged,
            "cycles" if course.periodic else "segments": course.segments,
            "intervals": "robust" if solution.converged else None,
            "variation_p": solution.variation_p,
            "excitation": {name: curve.excitation for name, curve in trajectories.items()},
            "torque_lag": parameters.lag,
            "reference": options.reference,
            **describe_alternatives(alternatives),
            "warnings": [
                *_warn_of_movement(trial, solution),
                *_warn_of_excitation(course.dimension, coordinate, trajectories),
                *_warn_of_search(solution),
                *warn_of_alternatives(alternatives),
            ],
        },
        predictor=model,
        trajectories=_tabulate(trial, solution, coordinate, trajectories),
    )


def _make_model(
    trial: PreparedTrial, solution: TimeVaryingSolution, options: RivTvOptions
) -> TimeVaryingModel:
    """The solution as a model that predicts."""
    equations = solution.equations
    course = equations.course
    bases = equations.bases
    parameters = solution.parameters
    delay = solution.delay
    basis = fit_basis(trial.velocity(delay), "rectifier", 1)
    variable = options.schedule
    if isinstance(options.cycle_onsets, str):
        variable = options.cycle_onsets
    coefficients = {name: parameters.linear[block] for name, block in bases.blocks.items()}
    return TimeVaryingModel(
        inputs=ModelInputs(basis, delay, equations.transform.rate, trial.rate),
        dimension=course.dimension,
        variable=variable,
        limits=np.array(course.limits),
        degree=bases.splines["K"].degree,
        stiffness=coefficients["K"],
        viscosity=coefficients["B"],
        gain=coefficients["G"],
        inertia=coefficients["I"],
        dynamics=parameters.dynamics,
        torque_lag=parameters.lag,
        rest_position=options.rest_position,
    )


def _tabulate(
    trial: PreparedTrial,
    solution: TimeVaryingSolution,
    coordinate: np.ndarray,
    trajectories: Mapping[str, Trajectory],
) -> xr.Dataset:
    """Trajectories with the ends of their bands, and with the scheduling variable that they follow.

    Shapes: coordinate (places,).
    """
    schedule = solution.equations.options.schedule
    values = {}
    for name, curve in trajectories.items():
        values[name] = curve.values
        values[f"{name}_low"] = curve.values - curve.margin
        values[f"{name}_high"] = curve.values + curve.margin
    dimension = solution.equations.course.dimension
    if schedule is None:
        return trajectory_dataset(dimension, coordinate, values)
    unit = str(trial.trial[schedule].attrs.get("units", ""))
    return trajectory_dataset(dimension, coordinate, values, variable=schedule, variable_unit=unit)


def _warn_of_movement(trial: PreparedTrial, solution: TimeVaryingSolution) -> list[str]:
    """Whether the slow movement follows the cycle or the schedule, and whether there are enough cycles."""
    equations = solution.equations
    course = equations.course
    position = trial.motion(equations.grid)[0]
    findings = check_slow_movement(
        position, course, equations.transform.rate, equations.options.schedule
    )
    warnings = [finding.text for finding in findings if finding.verdict != "ok"]
    if course.periodic and course.segments < FEW_CYCLES:
        warnings.append(
            f"{course.segments} cycles are few: the bands are too narrow below about {FEW_CYCLES}."
        )
    return warnings


def _warn_of_excitation(
    dimension: str, coordinate: np.ndarray, trajectories: Mapping[str, Trajectory]
) -> list[str]:
    """Where the record does not show a trajectory.

    Shapes: coordinate (places,).
    """
    warnings = []
    for name, curve in trajectories.items():
        edges = np.flatnonzero(np.diff(np.isnan(curve.values), prepend=False, append=False))
        ranges = [
            f"{coordinate[start]:.3g} to {coordinate[stop - 1]:.3g}"
            for start, stop in edges.reshape(-1, 2)
        ]
        if ranges:
            warnings.append(
                f"{name} is not identified at {dimension} {', '.join(ranges)}: it is hardly excited there."
            )
    return warnings


def _warn_of_search(solution: TimeVaryingSolution) -> list[str]:
    """Weak instruments, and a search that did not end."""
    warnings = []
    if solution.weakness_f < WEAK:
        warnings.append(
            f"the instruments are weak: their smallest canonical correlation with the regressors is "
            f"{solution.strength:.2g}. Record more cycles, perturb more strongly, or take fewer knots."
        )
    if not solution.converged:
        warnings.append(
            f"not converged after {solution.rounds} rounds: the trajectories have no bands."
        )
    return warnings


METHODS = (Method("riv-tv", RivTvOptions, identify_riv_tv),)
