"""Refined instrumental variables: physical parameters that torque fed back through the load cannot bias."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from math import inf
from typing import Any, Literal

from ankleloop.checks.reference import find_reference_fault
from ankleloop.errors import DataError
from ankleloop.joint.estimate import Estimate
from ankleloop.joint.hammerstein import NO_REFLEX
from ankleloop.joint.intervals import Uncertainty
from ankleloop.joint.models import ModelInputs, PhysicalModel
from ankleloop.joint.prepared import PreparedTrial, make_regressors
from ankleloop.joint.regressors import MOTION, merge_torques
from ankleloop.methods.method import (
    NOMINAL_DELAY,
    POSITION,
    BasisOptions,
    Method,
    Offer,
    RefinedOptions,
    Validity,
)
from ankleloop.methods.riv.alternatives import (
    find_alternatives,
    has_stretch_delay,
    normal_score,
    with_alternatives,
)
from ankleloop.methods.riv.constancy import (
    MIDDLE,
    Constancy,
    check_intervals,
    describe_changes,
    measure_constancy,
    measure_lags,
)
from ankleloop.methods.riv.covariance import apparatus_covariance, robust_covariance
from ankleloop.methods.riv.equations import (
    ABSENT_REFLEX,
    INCOMPLETE,
    LEAST_BESIDE_FILTERS,
    SHOWN_REFLEX,
    Equations,
    describe_lost_pole,
)
from ankleloop.methods.riv.search import Search, solve
from ankleloop.methods.riv.strength import check_answer, check_strength, find_unshown
from ankleloop.options import option
from ankleloop.quantities import STIFFNESS

# s, standard error: chosen. Measured, medians: 0.7 ms at a reflex gain of 13, 2.6 ms at 2, 4.7 ms at 1, where 36 of 60
# trials are below it, and 8 ms at 0.5, where 2 of 60 are.
CERTAIN_DELAY = 0.005


class RivOptions(RefinedOptions, BasisOptions):
    """Options of refined instrumental variables."""

    intervals: Literal["asymptotic", "robust", "between trials"] | None = option(
        None,
        "asymptotic, for a complete model; robust, for an incomplete one; between trials, for the mean over all such "
        "trials; null: as the record shows",
    )


def identify_riv(trials: Sequence[PreparedTrial], options: RivOptions) -> Estimate:
    r"""Estimate K, B, I and the reflex by refined instrumental variables, consistent in closed loop.

    The model is continuous in time,

    .. math:: TQ = K P + B \dot P + I \ddot P + e^{-s\tau} \frac{\omega_n^2}{s^2 + 2\zeta\omega_n s + \omega_n^2}
              \sum_k c_k\, g_k(\dot P) + v,

    with p / (s + p) as a further factor where `order` is 3, and v of any spectrum: voluntary torque and noise, which
    the load feeds back to P. The instruments are made of the reference alone. The position that the reference explains,
    a finite response to leads and lags of it, goes through the same model as the measured one, and the derivatives ψ of
    the torque with respect to the parameters θ, made of it, replace those of the measured position on the left:

    .. math:: \sum_f \Re\, \bar\psi(f)\, \hat\Phi_v(f)^{-1} \left[TQ(f) - \hat{TQ}(f; \hat\theta)\right] = 0.

    Weighting by the noise spectrum corresponds to prewhitening in time. Spectrum and derivatives are
    those of the parameters (Young 2011; Gilson, Garnier, Young and Van den Hof 2011). Of several trials the
    sums go over the frequencies of all of them, each with its own mean; the response to the reference and the noise
    spectrum are common to them. The search for the solution
    never ends worse than its start (`ankleloop.methods.riv.search.solve`), which is the best of a grid of dynamics for
    the predicted position, a fit to the torque that the reference explains.

    Intervals are for the parameters that the same model would have on an infinitely long record. Where the residual
    depends on the movement, the model is incomplete and asymptotic intervals do not hold: they are then robust
    (`ankleloop.methods.riv.covariance.robust_covariance`). There are none if the search has not converged.

    Samples that a filled gap of position or torque reaches are left out of the equations.

    Of several trials these intervals are for the mean over these trials. Those "between trials", from their scatter,
    are for the mean over all trials that there could be of such a condition. By default they are taken where a test at
    a level of 1 % shows that the trials differ, so a scatter that is smaller leaves intervals that hold the mean over
    these trials alone: ask for ``intervals="between trials"`` where the other one is meant.

    Parameters
    ----------
    trials : sequence of PreparedTrial
        One trial, or several of one joint in one condition.
    options : RivOptions
        A delay that is not given is estimated where the record shows it within a few milliseconds;
        elsewhere it is assumed to be 40 ms.

    Returns
    -------
    Estimate
        With 95 % intervals of K, B, I, G, ωn, ζ, of the third pole, of the threshold where the basis can have one, and
        of the delay where it is estimated. `diagnostics`: iterations, converged, criterion_start, criterion (size of
        the equations' left side at start and end, in units of its standard deviation, squared), intervals (asymptotic,
        robust or None), movement_p (probability of a residual that depends as much on the movement, if the model were
        complete), standard_errors,
        noise_frequency [Hz], noise_spectrum [(N·m)²/Hz], and alternatives: effects of the instruments or of the joint
        that the record shows and the model does not have, with
        their scores (size over standard error) and the relative shifts of K, B, I and G
        (`ankleloop.methods.riv.alternatives`), and shifts, those of all of them together, which intervals hold. Where a
        warning asks for options of `read_trial`, `remedy` has their values.

    Raises
    ------
    DataError
        If the instruments are weak (`ankleloop.methods.riv.strength.measure_strengths`), or the torque has nothing to
        do with the movement that the reference explains.

    References
    ----------
    P. C. Young, "Recursive Estimation and Time-Series Analysis", Springer, 2011. M. Gilson, H. Garnier, P. C. Young,
    P. Van den Hof, "Optimal instrumental variable method for closed-loop identification", IET Control Theory
    Appl. 5(10), 1147-1154, 2011.

    Examples
    --------
    >>> from ankleloop.methods.registry import identify
    >>> from ankleloop.simulation.simulate import simulate
    >>> estimate = identify(simulate(seed=1, voluntary=0.3), "riv")
    >>> low, high = estimate.intervals["K"]
    >>> low < 150.0 < high
    True
    """
    check_intervals(options.intervals, trials)
    solution, assumptions = find_solution(trials, options)
    if not solution.equations.open_loop:
        _check_instruments(solution, trials, options.reference)
    constancy = measure_constancy(solution) if solution.converged else None
    estimate = _estimate(trials, solution, options, assumptions, constancy)
    if not solution.converged:
        return estimate
    return with_alternatives(estimate, find_alternatives(solution), trials[0], options.tolerance)


def _check_instruments(solution: Search, trials: Sequence[PreparedTrial], reference: str) -> None:
    """Refuse instruments that say nothing, with what else is wrong with the reference."""
    for finding in (check_strength(solution), check_answer(solution)):
        if finding.verdict == "refused":
            faults = [find_reference_fault(trial, reference) for trial in trials]
            texts = dict.fromkeys(fault.text for fault in faults if fault)
            raise DataError(" ".join([*texts, finding.text]))


def find_solution(trials: Sequence[PreparedTrial], options: RivOptions) -> tuple[Search, list[str]]:
    """Solution of the equations, with the delay and the reflex that the record shows, and what is assumed."""
    solution = _solve(trials, options, estimate_delay=options.delay is None)
    assumptions = []
    if options.delay is None and not _shows_delay(solution):
        assumptions = [
            f"the reflex delay is {1000 * NOMINAL_DELAY:g} ms, since the record does not show it."
        ]
        solution = _solve(trials, options, estimate_delay=False)
    return _prefer_passive(solution), assumptions


def _solve(trials: Sequence[PreparedTrial], options: RivOptions, *, estimate_delay: bool) -> Search:
    """Solution of the equations, with the delay as an unknown or not."""
    records = make_regressors(
        trials,
        basis=options.basis or "rectifier",
        degree=options.degree,
        delay=NOMINAL_DELAY if options.delay is None else options.delay,
        identification_rate=options.identification_rate,
        reference=options.reference,
    )
    equations = Equations(trials, records, options.weighting)
    return solve(equations, equations.find_start(options.order, estimate_delay=estimate_delay))


def _shows_delay(solution: Search) -> bool:
    """Whether a solution with the delay as an unknown has that of a stretch reflex, and with a small error."""
    point = solution.point
    if not solution.converged or not has_stretch_delay(point) or point.values["G"] < 0.0:
        return False
    return solution.error("delay") < CERTAIN_DELAY


def _prefer_passive(solution: Search) -> Search:
    """Solution for a passive joint where the record shows no reflex, else the solution that is given."""
    if solution.converged and _score_reflex(solution) > SHOWN_REFLEX:
        return solution
    passive = solve(solution.equations, solution.point.parameters.without_reflex())
    is_passive = passive.converged and _score_reflex(passive) < ABSENT_REFLEX
    return passive if is_passive else solution


def _score_reflex(solution: Search) -> float:
    """Normal score of the coefficients of the reflex."""
    coefficients = solution.point.parameters.linear[MOTION:]
    block = slice(MOTION, MOTION + coefficients.size)
    return abs(normal_score(coefficients, solution.covariance[block, block]))


def _estimate(
    trials: Sequence[PreparedTrial],
    solution: Search,
    options: RivOptions,
    assumptions: list[str],
    constancy: Constancy | None,
) -> Estimate:
    """Torques, physical parameters, and where the search has converged their intervals."""
    equations = solution.equations
    point = solution.point
    parameters = point.parameters
    path = point.reflex_path
    values = point.values
    missing = []
    if path.passive:
        for name in parameters.dynamics.values:
            del values[name]
        missing = [f"ωn and ζ: {NO_REFLEX}."]
    if path.fault:
        del values["G"], values["threshold"]
        names = "G, ωn and ζ" if path.passive else "G"
        missing = [f"{names}: {path.fault}."]
    unshown, reason = find_unshown(solution)
    if unshown:
        hidden = list(unshown)
        if "G" in unshown:
            hidden += ["threshold", *parameters.dynamics.values]
        values = {name: value for name, value in values.items() if name not in hidden}
        missing.append(f"{', '.join(unshown)}: {reason}.")
    incomplete = []
    if point.movement_p < INCOMPLETE:
        incomplete = [
            "a part of the torque depends on the movement in a way that the model does not have: "
            f"{100 * point.movement_share:.2g} % of what it leaves unexplained."
        ]
    kind = None
    uncertainty = Uncertainty()
    changes: dict[str, list[str]] = {}
    apparatus: dict[str, Any] = {}
    if constancy is not None:
        kind, uncertainty, apparatus = _quantify(solution, values, options.intervals, constancy)
        find_lags = partial(measure_lags, solution)
        shown = {name: value for name, value in solution.shown_values.items() if name in values}
        changes = describe_changes(constancy, shown, options.tolerance, find_lags)
        if not (changes or constancy.merged):
            middle = measure_constancy(solution, MIDDLE)
            changes = describe_changes(middle, shown, options.tolerance, place=MIDDLE)
    inputs = replace(ModelInputs.of(equations.records[0]), delay=values["delay"])
    band = equations.band.parts[0]
    noise = point.noise[: band.frequency.size]
    model = PhysicalModel(
        inputs=inputs,
        stiffness=parameters.linear[:MOTION],
        coefficients=parameters.linear[MOTION:],
        dynamics=parameters.dynamics,
    )
    return Estimate(
        method="riv",
        torque=merge_torques([model.predict(trial) for trial in trials]),
        stiffness={name: values[name] for name in STIFFNESS if name in values},
        reflex={name: value for name, value in values.items() if name not in STIFFNESS},
        intervals=uncertainty.intervals(values),
        diagnostics={
            "order": options.order,
            "iterations": len(solution.points) - 1,
            "converged": solution.converged,
            "criterion_start": solution.points[0].merit(solution.free),
            "criterion": point.merit(solution.free),
            "reference": options.reference,
            "intervals": kind,
            "movement_p": point.movement_p,
            **uncertainty.diagnostics,
            **apparatus,
            "noise_frequency": band.frequency,
            "noise_spectrum": noise / band.density,
            "nonlinearity": path.curve(),
            "assumptions": assumptions,
            "missing": missing,
            "incomplete": incomplete,
            "warnings": [*_warnings(solution), *changes.get("warnings", ())],
            "remarks": changes.get("remarks", []),
        },
        predictor=model,
    )


def _quantify(
    solution: Search, values: Mapping[str, float], kind: str | None, constancy: Constancy
) -> tuple[str, Uncertainty, dict[str, Any]]:
    """Kind of the intervals, by default the one that the record asks for; and how uncertain parameters are.

    The covariance of an apparatus that is subtracted comes on top, with an entry of the diagnostics.
    """
    if kind is None:
        kind = "robust" if solution.point.movement_p < INCOMPLETE else "asymptotic"
        if constancy.differs:
            kind = "between trials"
    covariance = solution.covariance
    freedom = inf
    if kind == "between trials":
        covariance = constancy.covariance
        freedom = constancy.shares.size - 1
    elif kind == "robust":
        covariance, freedom = robust_covariance(solution.point, solution.free)
    apparatus: dict[str, Any] = {}
    carried = solution.equations.apparatus
    if carried is not None:
        shared = apparatus_covariance(solution.point, solution.free, carried)
        covariance = covariance + shared
        apparatus = carried.diagnostics(Uncertainty.of(values, solution.rows, shared))
    return kind, Uncertainty.of(values, solution.rows, covariance, freedom), apparatus


def _warnings(solution: Search) -> list[str]:
    """What the search did not reach, and what the record does not show."""
    warnings = []
    order = len(solution.point.parameters.dynamics.values)
    if solution.points[-1].pole_out_of_band or "pole" in solution.held:
        warnings.append(describe_lost_pole(order))
    if not solution.converged:
        warnings.append(
            f"not converged after {len(solution.points) - 1} iterations: the best one is given, without intervals. "
            "The record hardly shows some of the parameters."
        )
    return warnings


METHODS = (
    Method(
        "riv",
        RivOptions,
        identify_riv,
        merges=True,
        subtracts=True,
        least=LEAST_BESIDE_FILTERS,
        judges_reference=True,
        skips_gaps=True,
        validity=Validity(closed={}, without_reference=POSITION),
        offer=Offer(
            "Refined instrumental variables",
            options_without_reference={"weighting": "flat"},
            candidates_without_reference={"order": [2, 3]},
        ),
    ),
)
