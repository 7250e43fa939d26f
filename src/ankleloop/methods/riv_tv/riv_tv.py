"""Refined instrumental variables for joints that change in time: K, B and G over a cycle, over time, or a schedule."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ankleloop.checks.course import check_slow_movement, refuse_locked_perturbation
from ankleloop.checks.findings import name_trial
from ankleloop.joint.bases import RectifierBasis
from ankleloop.joint.estimate import Estimate
from ankleloop.joint.hammerstein import NO_REFLEX
from ankleloop.joint.intervals import Uncertainty
from ankleloop.joint.models import ModelInputs, TimeVaryingModel
from ankleloop.joint.prepared import PreparedTrial
from ankleloop.joint.regressors import merge_torques
from ankleloop.joint.time_varying_course import FEWEST_CYCLES, trajectory_dataset
from ankleloop.joint.verdicts import exceeds
from ankleloop.methods.method import POSITION, Method, Offer, Validity
from ankleloop.methods.riv.alternatives import (
    Alternative,
    choose_likeliest,
    compute_shifts,
    with_alternatives,
)
from ankleloop.methods.riv.constancy import (
    Constancy,
    check_intervals,
    compare_parts,
    describe_changes,
)
from ankleloop.methods.riv.equations import ABSENT_REFLEX, SHOWN_REFLEX, describe_lost_pole
from ankleloop.methods.riv.strength import WEAK
from ankleloop.methods.riv_tv.alternatives import find_alternatives
from ankleloop.methods.riv_tv.equations import TimeVaryingEquations
from ankleloop.methods.riv_tv.options import RivTvOptions
from ankleloop.methods.riv_tv.solution import MOST_ROUNDS, TimeVaryingSolution, solve_time_varying

PLACES = 101  # of a trajectory
FEW_CYCLES = 20  # below which bands are too narrow


def identify_riv_tv(trials: Sequence[PreparedTrial], options: RivTvOptions) -> Estimate:
    r"""Estimate K, B and G as functions of phase, time or a scheduling variable, consistent in closed loop.

    The model is

    .. math:: TQ = K(\tau) P + B(\tau) \dot P + I \ddot P + H\{G(\tau)\, \max(0, \dot P(t - d))\} + e(\tau) + v

    with a low-pass H of unit gain, a torque e that repeats with the cycle (or changes slowly), and v of any spectrum:
    voluntary torque and noise, which the load feeds back to P. K, B and G are cubic splines of τ, with penalties on
    their roughness whose weights restricted likelihood chooses. The instruments are the same regressors made of the
    position that movement and reference explain. What repeats with the cycle is taken out of torque, regressors and
    instruments. Frequencies are weighted by the inverse of the noise spectrum, and places by that of its level.
    Several trials are cycles, or movements, of one joint: their courses, their mean and their noise are common to them.

    Parameters
    ----------
    trials : sequence of PreparedTrial
        One trial, or several of one joint in one condition.
    options : RivTvOptions

    Returns
    -------
    Estimate
        `trajectories` holds K, B and G, and I where `inertia_knots` says so, with their 95 % bands; `stiffness`
        and `reflex` their means over the record, and I, delay and, unless the joint is passive, ωn, ζ. `diagnostics`:
        converged, cycles (or segments that count as independent), intervals (their kind), variation_p (probability of a
        variation as large, were K, B or G constant), excitation (information about each trajectory over its mean, at
        its places), torque_lag, and alternatives as of `ankleloop.methods.riv.riv.identify_riv`.

    References
    ----------
    D. L. Guarin, R. E. Kearney, "Estimation of time-varying, intrinsic and reflex dynamic joint stiffness during
    movement", Frontiers in Computational Neuroscience 11, 51, 2017. https://doi.org/10.3389/fncom.2017.00051
    S. N. Wood, M. Fasiolo, "A generalized Fellner-Schall method for smoothing parameter optimization", Biometrics
    73(4), 1071-1081, 2017. https://doi.org/10.1111/biom.12666
    D. Staiger, J. H. Stock, "Instrumental variables regression with weak instruments", Econometrica 65(3), 557-586,
    1997. https://doi.org/10.2307/2171753

    Examples
    --------
    >>> from ankleloop.methods.registry import identify
    >>> from ankleloop.simulation.simulate import simulate
    >>> trial = simulate(seed=1, duration=30.0, variation="cycle", stiffness_variation=0.4)
    >>> estimate = identify(trial, "riv-tv", cycle_onsets="phase")
    >>> bool(abs(float(estimate.trajectories["K"].sel(phase=0.5)) - 210.0) < 30.0)
    True
    """
    check_intervals(options.intervals, trials)
    solution = _solve(trials, options)
    if not solution.converged:
        return _estimate(trials, solution, options, None)
    constancy = measure_constancy(solution)
    estimate = _estimate(trials, solution, options, constancy)
    changes = describe_changes(constancy, solution.shown_means, options.tolerance)
    for kind, texts in changes.items():
        estimate.diagnostics[kind] = [*estimate.diagnostics.get(kind, ()), *texts]
    candidates = _list_alternatives(trials, solution, options)
    # One step does not tell what one effect leaves of another: the likeliest of those that matter most counts.
    large = [
        each
        for each in candidates
        if exceeds(each.shifts, options.tolerance) or each.is_other_delay
    ]
    alternatives = choose_likeliest(large) or choose_likeliest(candidates)
    return with_alternatives(estimate, alternatives, trials[0], options.tolerance)


def _solve(trials: Sequence[PreparedTrial], options: RivTvOptions) -> TimeVaryingSolution:
    """Solution of the equations of trials, whose perturbation must not repeat with the cycle."""
    for trial in trials:
        trial.check_variable(options.reference)
    equations = TimeVaryingEquations(trials, options)
    if equations.course.periodic:
        refuse_locked_perturbation(
            equations.find_reference(),
            equations.course,
            equations.smooth_part.part,
            options.reference,
        )
    solution = solve_time_varying(equations)
    if solution.converged and solution.reflex_score > SHOWN_REFLEX:
        return solution
    passive = solve_time_varying(equations, passive=True)
    is_passive = passive.converged and passive.reflex_score < ABSENT_REFLEX
    return passive if is_passive else solution


def measure_constancy(solution: TimeVaryingSolution) -> Constancy:
    """Deviations of the means of K, B, I and G in the trials, or in the halves of a single one."""
    contributions = solution.system.instruments * solution.residual
    return compare_parts(
        contributions=contributions,
        recorded=np.ones(contributions.shape[1], dtype=bool),
        sizes=[part.segment.size for part in solution.equations.course.parts],
        normal=solution.system.normal + solution.penalty,
        covariance=solution.covariance,
        rows=solution.parameter_rows,
    )


def _list_alternatives(
    trials: Sequence[PreparedTrial], solution: TimeVaryingSolution, options: RivTvOptions
) -> list[Alternative]:
    """What the model may lack; one step is too short for a delay, so the equations are solved for it."""
    alternatives = []
    for alternative in find_alternatives(solution):
        if alternative.effect == "delay" and alternative.significant:
            freed = _solve(trials, options.model_copy(update={"delay": None}))
            shifts = compute_shifts(solution.shown_means, freed.means)
            alternative = replace(alternative, size=freed.delay, shifts=shifts)
        alternatives.append(alternative)
    return alternatives


def _estimate(
    trials: Sequence[PreparedTrial],
    solution: TimeVaryingSolution,
    options: RivTvOptions,
    constancy: Constancy | None,
) -> Estimate:
    """Torques, trajectories with their bands, and means over the record."""
    equations = solution.equations
    course = equations.course
    places = np.linspace(0.0, 1.0, PLACES)
    coordinate = np.linspace(*course.limits, PLACES)
    curves, excitations = solution.find_trajectories(places)
    model = _make_model(trials, solution, options)
    parts = zip(trials, equations.grids, course.parts, strict=True)
    torques = [model.torques(trial, grid, part.place) for trial, grid, part in parts]
    means = solution.means
    reflex = {"delay": solution.delay, "G": means.pop("G")}
    missing = [f"ωn and ζ: {NO_REFLEX}."]
    if not solution.parameters.passive:
        reflex |= solution.parameters.dynamics.values
        missing = []
    values = {**means, **reflex}
    kind = None
    uncertainty = Uncertainty()
    apparatus: dict[str, Any] = {}
    if constancy is not None:
        kind = options.intervals or ("between trials" if constancy.differs else "robust")
        covariance = solution.covariance
        freedom = course.segments - 1
        if kind == "between trials":
            covariance = constancy.covariance
            freedom = len(trials) - 1
        shared = solution.apparatus_covariance
        rows = solution.parameter_rows
        uncertainty = Uncertainty.of(values, rows, covariance + shared, freedom)
        carried = trials[0].apparatus
        if carried is not None:
            apparatus = carried.diagnostics(Uncertainty.of(values, rows, shared))
    schedule = {}
    if options.schedule:
        unit = str(trials[0].trial[options.schedule].attrs.get("units", ""))
        schedule = {"variable": options.schedule, "variable_unit": unit}
    return Estimate(
        method="riv-tv",
        torque=merge_torques(torques),
        stiffness=means,
        reflex=reflex,
        intervals=uncertainty.intervals(values),
        diagnostics={
            "order": options.order,
            "converged": solution.converged,
            "cycles" if course.periodic else "segments": course.segments,
            "intervals": kind,
            **uncertainty.diagnostics,
            **apparatus,
            "variation_p": solution.variation_p,
            "excitation": excitations,
            "torque_lag": solution.parameters.lag,
            "reference": options.reference,
            "missing": missing,
            "warnings": _warnings(trials, solution, coordinate, curves),
        },
        predictor=model,
        trajectories=trajectory_dataset(course.dimension, coordinate, curves, **schedule),
    )


def _make_model(
    trials: Sequence[PreparedTrial], solution: TimeVaryingSolution, options: RivTvOptions
) -> TimeVaryingModel:
    """The solution as a model that predicts."""
    equations = solution.equations
    bases = equations.bases
    parameters = solution.parameters
    velocities = [trial.velocity(solution.delay) for trial in trials]
    basis = RectifierBasis.fit(np.concatenate(velocities), degree=1)
    variable = options.schedule
    if isinstance(options.cycle_onsets, str):
        variable = options.cycle_onsets
    coefficients = {name: parameters.linear[block] for name, block in bases.blocks.items()}
    return TimeVaryingModel(
        inputs=ModelInputs(basis, solution.delay, equations.transform.rate, trials[0].rate),
        dimension=equations.course.dimension,
        variable=variable,
        limits=np.array(equations.course.limits),
        degree=bases.splines["K"].degree,
        stiffness=coefficients["K"],
        viscosity=coefficients["B"],
        gain=coefficients["G"],
        inertia=coefficients["I"],
        dynamics=parameters.dynamics,
        torque_lag=parameters.lag,
        rest_position=options.rest_position,
    )


def _warnings(
    trials: Sequence[PreparedTrial],
    solution: TimeVaryingSolution,
    coordinate: np.ndarray,
    curves: Mapping[str, np.ndarray],
) -> list[str]:
    """What the record does not show, or the search did not reach."""
    equations = solution.equations
    course = equations.course
    warnings = []
    parts = zip(trials, equations.grids, course.parts, strict=True)
    for number, (trial, grid, part) in enumerate(parts, 1):
        if part.segments >= FEWEST_CYCLES:
            findings = check_slow_movement(
                trial.motion(grid)[0], part, equations.transform.rate, equations.options.schedule
            )
            place = name_trial(number, len(trials))
            warnings += [f"{place}{f.text}" for f in findings if f.verdict != "ok"]
    if course.periodic and course.segments < FEW_CYCLES:
        warnings.append(
            f"{course.segments} cycles are few: the bands are too narrow below about {FEW_CYCLES}."
        )
    for name in equations.bases.trajectories:
        edges = np.flatnonzero(np.diff(np.isnan(curves[name]), prepend=False, append=False))
        ranges = [
            f"{coordinate[start]:.3g} to {coordinate[stop - 1]:.3g}"
            for start, stop in edges.reshape(-1, 2)
        ]
        if ranges:
            warnings.append(
                f"{name} is not identified at {course.dimension} {', '.join(ranges)}: it is hardly excited there."
            )
    if solution.weakness_f < WEAK:
        warnings.append(
            "the instruments are weak: their smallest canonical correlation with the regressors is "
            f"{solution.strength:.2g}. Record more cycles, perturb more strongly, or take fewer knots."
        )
    if solution.pole_out_of_band:
        warnings.append(describe_lost_pole(equations.options.order))
    if not solution.converged:
        warnings.append(
            f"not converged after {MOST_ROUNDS} rounds: the trajectories have no bands."
        )
    return warnings


METHODS = (
    Method(
        "riv-tv",
        RivTvOptions,
        identify_riv_tv,
        merges=True,
        subtracts=True,
        validity=Validity(closed={}, without_reference=POSITION),
        offer=Offer(
            "Joint that changes (riv-tv)",
            options_without_reference={"weighting": "flat"},
            changing=True,
        ),
    ),
)
