"""The apparatus without a subject: inertia, viscosity, stiffness and friction of what the torque sensor carries."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
from typing import Any

import numpy as np
import xarray as xr
from scipy import special

from ankleloop.errors import DataError
from ankleloop.joint.apparatus import APPARATUS, ATTRIBUTE, Apparatus
from ankleloop.joint.bases import FRICTION
from ankleloop.joint.estimate import Estimate
from ankleloop.joint.intervals import Uncertainty
from ankleloop.joint.models import ApparatusModel, ModelInputs
from ankleloop.joint.prepared import PreparedTrial
from ankleloop.joint.regressors import MOTION, Regressors, merge_torques
from ankleloop.methods.method import (
    POSITION,
    Method,
    MethodOptions,
    Offer,
    Validity,
    reference_option,
)
from ankleloop.methods.riv.alternatives import normal_score
from ankleloop.methods.riv.covariance import robust_covariance
from ankleloop.methods.riv.equations import (
    INCOMPLETE,
    LEAST_BESIDE_FILTERS,
    NOMINAL_DYNAMICS,
    Equations,
    Parameters,
    Point,
)
from ankleloop.options import option, show_value
from ankleloop.signals.decimation import decimate
from ankleloop.signals.least_squares import invert_scaled, solve_scaled
from ankleloop.signals.responses import RESPONSE_LEADS, apply_response, fit_finite_response

ALL = np.arange(len(APPARATUS))
WITHOUT_STIFFNESS = ALL[1:]
SHOWN = 3.0  # standard errors of a stiffness, or a friction, that the record shows
# A velocity within this share of its deviation is rest. Measured: 2 % of a slide on a path, 5 to 11 % of a device that
# wanders under a PRBS, 49 to 54 % of one that rests between the steps of a PRBS; there K is far off.
SLOW = 0.05
LARGEST_REST = 0.25  # of the record
ELASTIC_SHARE = 0.05  # of the torque's deviation: what a joint resists stretch with is more
REFLEX_DELAYS = (0.03, 0.05, 0.08)  # s


class ApparatusOptions(MethodOptions):
    """Options of the method for a device without a subject."""

    reference: str = reference_option()
    highest_frequency: float | None = option(
        None,
        "upper edge of the band of the fit; null for that of riv, 0.38 times the rate of the identification",
        unit="Hz",
        ge=1,
        le=4000,
    )


class ApparatusParameters(Parameters):
    """K, B, I and the friction, which answers the sign of the velocity at once."""

    def responses(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Response of one, without unknowns."""
        return np.ones(s.size), np.empty((0, s.size))


def identify_apparatus(trials: Sequence[PreparedTrial], options: ApparatusOptions) -> Estimate:
    r"""Estimate what a device without a subject adds to the torque, by instruments of the reference.

    .. math:: TQ = I \ddot P + B \dot P + K P + F \, \mathrm{sign}(\dot P) + c + v

    These are the equations of `riv` without a reflex, linear in I, B, K and the Coulomb friction F:

    .. math:: \sum_f \Re\, \bar\psi(f) \left[TQ(f) - \hat{TQ}(f; \hat\theta)\right] = 0,

    with derivatives ψ of the torque that are made of the position that the reference explains. For the sign of the
    velocity its mean stands there, :math:`\mathrm{erf}(\dot P_r / \sqrt{2} \sigma)` with the velocity :math:`\dot P_r`
    that the reference explains and the deviation σ of the other one. So torque that is fed back to the movement biases
    nothing. All frequencies of the band have the same weight, because friction of a real bearing is not constant: the
    estimate is then the closest one of this form.

    A stiffness that the record does not show, by three standard errors, is 0.

    Parameters
    ----------
    trials : sequence of PreparedTrial
        One trial, or several of one device. A slide that moves by m under N is read as if these were rad and N·m: I is
        then its mass [kg], B in N·s/m, K in N/m, and the friction in N.
    options : ApparatusOptions

    Returns
    -------
    Estimate
        "K", "B", "I", "friction" [N·m] and "offset" [N·m], the torque at rest at position 0, are in `stiffness`, with
        95 % intervals. They are robust where a part of the torque depends on the movement otherwise
        (`ankleloop.methods.riv.covariance.robust_covariance`). `diagnostics`: movement_p, intervals ("asymptotic" or
        "robust"), covariance, noise_frequency [Hz], noise_spectrum [(N·m)²/Hz].

    See Also
    --------
    ankleloop.methods.riv.riv.identify_riv : The joint.

    References
    ----------
    A. Janot, M. Gautier, M. Brunot, "Data set and reference models of EMPS", Workshop on Nonlinear System
    Identification Benchmarks, 2019.

    Examples
    --------
    >>> from ankleloop.methods.registry import identify
    >>> from ankleloop.simulation.simulate import simulate
    >>> spring = simulate(seed=1, duration=20.0, stiffness=5.0, reflex_gain=0.0, voluntary=0.0)
    >>> estimate = identify(spring, "apparatus")
    >>> low, high = estimate.intervals["I"]
    >>> low < 0.015 < high
    True
    """
    equations = _make_equations(trials, options)
    free = ALL
    point = _solve(equations, free)
    if abs(_score_unknowns(point)["K"]) < SHOWN:
        free = WITHOUT_STIFFNESS
        point = _solve(equations, free)
    return _estimate(trials, point, free, options)


def is_device(trials: Sequence[PreparedTrial], reference: str, rate: float) -> bool:
    """Whether records may be those of a device: hardly a stiffness, or friction and no reflex."""
    options = ApparatusOptions(reference=reference, identification_rate=rate)
    point = _solve(_make_equations(trials, options), ALL)
    scores = _score_unknowns(point)
    if scores["I"] < SHOWN:
        return False
    stiffness, *_ = point.parameters.linear
    elastic = stiffness * np.std(point.equations.inputs[0])
    if abs(elastic) < ELASTIC_SHARE * np.std(point.equations.records[0].torque):
        return True
    return scores["friction"] > SHOWN and _score_reflex(point) < SHOWN


def _make_equations(trials: Sequence[PreparedTrial], options: ApparatusOptions) -> Equations:
    """Equations whose inputs are position, velocity, acceleration and the sign of the velocity.

    The instrument of the friction is the sign that is expected where the reference explains some velocity. The sign of
    that velocity itself would be one of rounding and fed-back torque where the device is nearly at rest.
    """
    records = [
        trial.regressors(
            delay=0.0,
            basis=FRICTION,
            identification_rate=options.identification_rate,
            reference=options.reference,
        )
        for trial in trials
    ]
    equations = Equations(trials, records, "flat", options.highest_frequency or inf)
    if equations.open_loop:
        return equations
    motion = np.hstack(_predict_motion(trials, records))
    velocity = motion[1]
    other = np.std(equations.inputs[1] - velocity)  # that the reference does not explain
    friction = special.erf(velocity / (np.sqrt(2.0) * other))
    equations.predicted_inputs = np.vstack([motion, friction])
    equations.predicted = equations.band.transform(equations.predicted_inputs)
    return equations


def _predict_motion(
    trials: Sequence[PreparedTrial], records: Sequence[Regressors]
) -> list[np.ndarray]:
    """Position, velocity and acceleration that the reference explains, each half by the response of the others.

    A response follows some of the torque that is fed back in the samples that it is fitted to. What is linear in the
    movement hardly feels that, but the sign of a small velocity does.

    Shapes: returns (3, N) for each record.
    """
    rate = records[0].rate
    name = str(records[0].reference_name)
    references = [
        trial.channel(name, record.grid) for trial, record in zip(trials, records, strict=True)
    ]
    middles = [record.time.size // 2 for record in records]
    firsts = [slice(None, middle) for middle in middles]
    seconds = [slice(middle, None) for middle in middles]
    predicted = [np.empty((MOTION, record.time.size)) for record in records]
    for fitted, unseen in ((firsts, seconds), (seconds, firsts)):
        taps = fit_finite_response(
            [record.inputs[part, 0] for record, part in zip(records, fitted, strict=True)],
            [reference[part] for reference, part in zip(references, fitted, strict=True)],
            rate,
        )
        for trial, record, motion, part in zip(trials, records, predicted, unseen, strict=True):
            for order, row in enumerate(motion):
                samples = trial.samples[name]
                source = decimate(samples, *record.grid, rate=trial.rate, derivative=order)
                explained = apply_response(taps, source, round(RESPONSE_LEADS * rate))
                row[part] = explained[part]
    return predicted


def _score_unknowns(point: Point) -> dict[str, float]:
    """Each unknown over its standard error."""
    _, covariance, _ = _quantify(point, ALL)
    scores = point.parameters.linear / np.sqrt(np.diag(covariance))
    return dict(zip(APPARATUS, scores.tolist(), strict=True))


def _score_reflex(point: Point) -> float:
    """Normal score of the reflex that the record shows beside an apparatus, of usual dynamics and several delays."""
    equations = point.equations
    band = equations.band
    late = np.exp(-np.outer(REFLEX_DELAYS, band.s)) * NOMINAL_DYNAMICS.response(band.s)[0]
    regressors, instruments = (
        np.vstack([inputs, equations.select_recorded(late * band.transform(velocity.clip(0.0)))])
        for inputs, velocity in (
            (point.regressors, equations.inputs[1]),
            (point.instruments, equations.predicted_inputs[1]),
        )
    )
    weighted = instruments.conj() / point.level
    inverse = invert_scaled(np.real(weighted @ regressors.T))
    sizes = inverse @ np.real(weighted @ point.residual)
    covariance = inverse @ point.scatter_of(weighted) @ inverse.T
    reflex = slice(ALL.size, None)
    return abs(normal_score(sizes[reflex], covariance[reflex, reflex]))


def _solve(equations: Equations, free: np.ndarray) -> Point:
    """The solution of the equations, whose other unknowns are 0."""
    start = ApparatusParameters(
        linear=np.zeros(len(APPARATUS)), dynamics=NOMINAL_DYNAMICS, passive=True
    )
    point = Point(equations, start)
    step = np.zeros(len(APPARATUS))
    step[free] = solve_scaled(point.normal[np.ix_(free, free)], point.side[free])
    return Point(equations, start.add(step))


def _quantify(point: Point, free: np.ndarray) -> tuple[str, np.ndarray, float]:
    """Kind of the intervals, covariance of the unknowns that are free, and its degrees of freedom."""
    if point.movement_p < INCOMPLETE:
        return "robust", *robust_covariance(point, free)
    return "asymptotic", point.covariance(free), inf


def _estimate(
    trials: Sequence[PreparedTrial], point: Point, free: np.ndarray, options: ApparatusOptions
) -> Estimate:
    """Parameters with their intervals, and torques."""
    equations = point.equations
    kind, covariance, freedom = _quantify(point, free)
    names = [APPARATUS[number] for number in free]
    linear = point.parameters.linear
    offset, row, variance = _measure_offset(point, free)
    values = {**dict(zip(APPARATUS, linear.tolist(), strict=True)), "offset": offset}
    # The offset is a further unknown, which depends on the others.
    whole = np.zeros((free.size + 1, free.size + 1))
    whole[:-1, :-1] = covariance
    whole[-1, -1] = variance
    rows: dict[str, np.ndarray] = dict(zip(names, np.eye(free.size, free.size + 1), strict=True))
    rows["offset"] = np.append(row, 1.0)
    uncertainty = Uncertainty.of(values, rows, whole, freedom)
    missing = []
    if "K" not in names:
        missing = ["K: the record shows no stiffness, so it is 0."]
    incomplete = []
    if kind == "robust":
        incomplete = [
            "a part of the torque depends on the movement in a way that the model does not have: "
            f"{100 * point.movement_share:.2g} % of what it leaves unexplained."
        ]
    model = ApparatusModel(
        inputs=ModelInputs.of(equations.records[0]),
        stiffness=linear[:MOTION],
        friction=float(linear[MOTION]),
    )
    band = equations.band.parts[0]
    diagnostics: dict[str, Any] = {
        "reference": options.reference,
        "intervals": kind,
        "movement_p": point.movement_p,
        **uncertainty.diagnostics,
        "noise_frequency": band.frequency,
        "noise_spectrum": point.noise[: band.frequency.size] / band.density,
        "missing": missing,
        "warnings": _list_warnings(point),
        "source": ", ".join(dict.fromkeys(trial.trial.attrs.get("source", "") for trial in trials)),
        "incomplete": incomplete,
    }
    return Estimate(
        method="apparatus",
        torque=merge_torques([model.predict(trial) for trial in trials]),
        stiffness=values,
        reflex={},
        intervals=uncertainty.intervals(values),
        diagnostics=diagnostics,
        predictor=model,
    )


def _list_warnings(point: Point) -> list[str]:
    """A device that rests on its friction: that is then any up to the one of its movement."""
    velocity = point.equations.inputs[1]
    share = np.mean(np.abs(velocity) < SLOW * np.std(velocity))
    if share < LARGEST_REST or _score_unknowns(point)["friction"] < SHOWN:
        return []
    return [
        f"the device rests for {100 * share:.0f} % of the record, where its friction is not that of a movement: record "
        "it by a command that keeps it moving, with a slow wander of some times the perturbation."
    ]


def _measure_offset(point: Point, free: np.ndarray) -> tuple[float, np.ndarray, float]:
    """Mean of what is left of the torque, its slopes by the free unknowns, and its variance if these are known.

    The variance of a mean is half the one-sided density of the noise at low frequencies over the duration.

    Shapes: returns slopes (free,).
    """
    equations = point.equations
    torque = np.concatenate([record.torque for record in equations.records])
    means = equations.inputs.mean(axis=1)
    offset = float(torque.mean() - point.parameters.linear @ means)
    band = equations.band
    density = point.noise[0] / band.parts[0].density
    return offset, -means[free], float(0.5 * density * band.rate / band.samples)


def subtract(trial: xr.Dataset, apparatus: Estimate) -> xr.Dataset:
    """Subtract what a device alone does to the torque of a trial.

    The trial carries the apparatus: its samples stay as they were recorded. What is identified of it, by `riv` or
    `riv-tv`, is the limb alone, in parameters and in torques. Intervals hold the uncertainty of the apparatus, too. It
    is the same in all trials that carry this apparatus, so that it does not shrink in a mean over them, and cancels in
    a difference (`ankleloop.compare`).

    Parameters
    ----------
    trial : xarray.Dataset
        A trial with a subject.
    apparatus : Estimate
        Of the same device without one, by the method `apparatus`.

    Returns
    -------
    xarray.Dataset
        The trial with the attribute `apparatus`, which files of trials hold as well.

    Raises
    ------
    DataError
        If the estimate is by another method or has a warning, or the trial carries an apparatus.
    TypeError
        For what is no estimate.

    See Also
    --------
    ankleloop.read_trial : Subtracts a saved estimate, too.

    Examples
    --------
    >>> from ankleloop.methods.registry import identify
    >>> from ankleloop.simulation.simulate import simulate
    >>> plate = {"stiffness": 0.0, "viscosity": 0.1, "inertia": 0.005, "reflex_gain": 0.0, "voluntary": 0.0}
    >>> apparatus = identify(simulate(seed=1, duration=20.0, **plate), "apparatus")
    >>> trial = simulate(seed=2, duration=20.0, inertia=0.02)
    >>> limb = subtract(trial, apparatus)
    >>> round(identify(trial, "riv")["I"], 3), round(identify(limb, "riv")["I"], 3)
    (0.02, 0.015)
    """
    if not isinstance(apparatus, Estimate):
        raise TypeError(f"subtract: apparatus must be an Estimate, got {show_value(apparatus)}.")
    if apparatus.method != "apparatus":
        raise DataError(
            f"the estimate is by {apparatus.method}: identify the empty device by the method 'apparatus'."
        )
    if apparatus.fit_warnings:
        raise DataError(
            f"the apparatus cannot be trusted: {apparatus.fit_warnings[0]} Record the empty device again."
        )
    if ATTRIBUTE in trial.attrs:
        raise DataError(
            "an apparatus is subtracted of this trial already: take the trial as it was."
        )
    carried = Apparatus(
        source=str(apparatus.diagnostics["source"]),
        values={name: apparatus[name] for name in APPARATUS},
        covariance=apparatus.covariance.reindex(APPARATUS, axis="columns")
        .dropna(axis="columns")
        .reindex(APPARATUS)
        .dropna()
        .to_dict(),
    )
    return trial.assign_attrs({ATTRIBUTE: carried.dump()})


METHODS = (
    Method(
        "apparatus",
        ApparatusOptions,
        identify_apparatus,
        merges=True,
        least=LEAST_BESIDE_FILTERS,
        skips_gaps=True,
        validity=Validity(closed={}, without_reference=POSITION),
        offer=Offer("Apparatus without a subject"),
        of_device=True,
    ),
)
