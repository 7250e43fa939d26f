"""Does the torque feed back on the position, and by how much could that bias K? A test for closed loop."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import special

from ankleloop.checks.findings import Finding
from ankleloop.checks.movement import project_records
from ankleloop.errors import DataError
from ankleloop.joint.regressors import MOTION, Regressors
from ankleloop.signals.decimation import PASSBAND
from ankleloop.signals.least_squares import fit_scaled, solve_scaled
from ankleloop.signals.responses import ReferenceProjection, lag_matrix
from ankleloop.signals.spectra import coherence, segment_spectra

SEGMENT_DURATION = 2.0  # s
FEWEST_SEGMENTS = 4  # with fewer, nothing but a very strong coherence would be seen
LOWEST_FREQUENCY, HIGHEST_FREQUENCY = 0.5, 20.0  # Hz, of the coherence
BINS_APART = 3  # the values of a Hann window are independent then
SIGNIFICANCE = 0.01
LARGEST_BIAS = 2.0  # % of K: the scatter of K in a record of a minute (95 % interval of riv) hides a smaller bias
SHOWN_BIAS = 0.1  # % of K: a smaller limit is not spelt out
REFLEX_LAGS = 0.4  # s
DISCARDED_SHARE = 1e-6  # of the largest singular value


@dataclass(frozen=True)
class FeedbackTest:
    """Outcome of the test."""

    p_value: float  # probability of such a coherence if torque did not move the joint
    # Mean squared coherence of the movement that the reference does not explain with the torque that the movement
    # does not explain.
    coherence: float
    # Between −1 and 1: positive if that torque does work on the load, as it must on a passive load that gives way.
    work: float
    bias: float  # bias of K by least squares that feedback causes [% of K]
    margin: float  # half width of its 98 % interval [% of K]
    duration: float  # length of the segments that were tested [s]

    @property
    def loop(self) -> str:
        """The outcome: "closed", "open" or "undecided"."""
        if self.p_value < SIGNIFICANCE and self.work > 0.0:
            return "closed"
        return "open" if self.limit < LARGEST_BIAS else "undecided"

    @property
    def limit(self) -> float:
        """Upper 99 % confidence limit of the magnitude of the bias [% of K]."""
        return abs(self.bias) + self.margin

    @property
    def sufficient_duration(self) -> float:
        """Length of segments for which the margin would be half of the largest bias that does not matter [s]."""
        return self.duration * (2.0 * self.margin / LARGEST_BIAS) ** 2


def feedback_test(
    records: Sequence[Regressors], projection: ReferenceProjection | None = None
) -> FeedbackTest:
    r"""Test whether torque that the reference does not explain moves the joint, and how much that matters for K.

    **Detection.** The response to leads and lags of the reference is removed from position and torque, which leaves e_P
    and e_T. What the joint answers to e_P, by the response Q that it has to the reference, is removed from the torque
    as well, which leaves n = e_T − Q e_P: voluntary torque and noise. A servo that does not follow its command moves
    the joint, and n is not related to that movement. Against a compliant load the joint gives way to n, e_P = −F n, and
    n does work on the load. The squared coherence of m segments, if there is none, has a known distribution at each
    frequency, whatever the spectra are:

    .. math:: -2 (m - 1) \ln(1 - C^2) \sim \chi^2_2 .

    Its sum over independent frequencies between 0.5 and 20 Hz is the statistic. The sign of the cross spectrum of
    velocity and n is that of the power.

    **Size.** That no feedback was detected does not exclude it. What it can do is therefore bounded. Write the torque
    as TQ = φ'θ + n with φ = [P, Ṗ, P̈] and θ = [K, B, I]. With H the load and Q the joint, the movement that the
    reference does not explain is

    .. math:: e_P = -F n + w, \qquad F = \frac{H}{1 + H Q},

    and w what else moves the joint, unrelated to n. Least squares then has the bias

    .. math:: \hat\theta_{LS} - \theta \to E[\varphi\varphi']^{-1} E[e_\varphi n], \qquad
              \text{for K alone} \quad \frac{\mathrm{cov}(e_P, n)}{\mathrm{var}(P)} .

    The part φ_r = Πφ that leads and lags of the reference explain is unrelated to n, so two-stage least squares,
    (φ'Πφ)⁻¹ φ'Π TQ, does not have it. The difference of both estimates measures the bias (Hausman 1978). It is linear
    in n, with weights a that vanish where nothing but the reference moves the joint:

    .. math:: d = \sum_t a_t n_t, \qquad
              a = [(\varphi'\varphi)^{-1} \varphi' - (\varphi'\Pi\varphi)^{-1} \varphi'\Pi]_K .

    So a stiff servo can be recognised in a short record, and a weak feedback needs a long one. The variance of d comes
    from the sums of a·n over segments, its margin from Student's distribution. The response to the reference also fits
    a part of e_P; d and its margin are divided by the share that it leaves. Both are given in per cent of K, which is
    that of least squares with the reflex as a finite response, less d.

    Noise of the position contributes to d as well: it, too, biases least squares.

    **Outcome.** Closed, if the coherence is significant (1 %) and the torque does work on the load. Otherwise open, if
    the upper limit of the bias is below 2 %, and undecided if it is not. The limit is for K; in per cent, the same
    feedback can bias B several times as much.

    Parameters
    ----------
    records : sequence of Regressors
        Records of one joint at one identification rate, with reference and rectified velocity (basis "rectifier"); a
        stretch is opposed by a positive torque. Several records are tested together.
    projection : ReferenceProjection, optional
        That of the records (`ankleloop.checks.movement.project_records`), where it has been computed already.

    Returns
    -------
    FeedbackTest

    Raises
    ------
    DataError
        If there are too few segments.

    References
    ----------
    J. A. Hausman, "Specification tests in econometrics", Econometrica 46(6), 1251-1271, 1978.
    https://doi.org/10.2307/1913827

    Examples
    --------
    >>> from ankleloop.joint.prepared import prepare
    >>> from ankleloop.simulation.simulate import simulate
    >>> options = {"delay": 0.04, "basis": "rectifier", "identification_rate": 100.0, "reference": "reference"}
    >>> trials = [simulate(seed=1, duration=30.0, closed_loop=closed) for closed in (True, False)]
    >>> [feedback_test([prepare(trial).regressors(**options)]).loop for trial in trials]
    ['closed', 'open']
    """
    rate = records[0].rate
    projection = projection or project_records(records)
    length = round(SEGMENT_DURATION * rate)
    segments = sum(len(part) // length for part in projection.signals)
    if segments < FEWEST_SEGMENTS:
        unused = projection.rows / rate - segments * SEGMENT_DURATION
        missing = (FEWEST_SEGMENTS - segments) * SEGMENT_DURATION - unused
        raise DataError(
            f"beside the response to the reference there are {segments} segments of {SEGMENT_DURATION:g} s, and the "
            f"test needs {FEWEST_SEGMENTS}: record {missing:.2g} s more."
        )
    p_value, mean_coherence, work = _test_coherence(projection, length, rate)
    difference, half_width = _bound_bias(projection, length)
    percent = 100.0 / abs(fit_stiffness(records) - difference)
    return FeedbackTest(
        p_value=p_value,
        coherence=mean_coherence,
        work=work,
        bias=difference * percent,
        margin=half_width * percent,
        duration=segments * SEGMENT_DURATION,
    )


def _test_coherence(
    projection: ReferenceProjection, length: int, rate: float
) -> tuple[float, float, float]:
    """Probability of the coherence if the residuals were unrelated, its mean, and the sign of the power."""
    frequency = np.fft.rfftfreq(length, 1.0 / rate)
    highest = min(HIGHEST_FREQUENCY, PASSBAND * rate)
    inside = np.flatnonzero((frequency >= LOWEST_FREQUENCY) & (frequency <= highest))
    bins = inside[::BINS_APART]
    position, torque = _transform(projection.residuals, length, bins)
    whole_position, whole_torque = _transform(projection.signals, length, bins)
    explained_position = whole_position - position
    explained_torque = whole_torque - torque
    power = np.sum(np.abs(position) ** 2, axis=0)
    explained_power = np.sum(np.abs(explained_position) ** 2, axis=0)
    joint = np.sum(explained_torque * explained_position.conj(), axis=0) / explained_power
    noise = torque - joint * position
    # The response of the joint is itself an estimate, which adds to the scatter of the cross spectrum.
    squared = coherence(position, noise) / (1.0 + power / explained_power)
    # The response to the reference takes its share of the independent segments.
    freedom = len(position) * projection.shrinkage - 1.0
    statistic = -2.0 * freedom * np.sum(np.log1p(-np.minimum(squared, 1.0 - 1e-12)))
    p_value = float(special.chdtrc(2 * bins.size, statistic))
    # Velocity leads position by a quarter of a period; its product with the torque is power.
    cross = np.sum(position * noise.conj(), axis=0)
    work = float(np.sum(squared * np.sin(np.angle(cross))) / np.sum(squared))
    return p_value, float(squared.mean()), work


def _transform(
    records: Sequence[np.ndarray], length: int, bins: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Spectra of position and torque in segments of all records, shapes (segments, bins)."""
    position, torque = (
        segment_spectra([record[:, channel] for record in records], length, length)[:, bins]
        for channel in (0, MOTION)
    )
    return position, torque


def _bound_bias(projection: ReferenceProjection, length: int) -> tuple[float, float]:
    """Least squares less two-stage least squares for K, and the half width of its 98 % interval [N·m/rad]."""
    signals = np.concatenate(projection.signals)
    residuals = np.concatenate(projection.residuals)
    motion = signals[:, :MOTION]
    torque = signals[:, MOTION]
    instruments = motion - residuals[:, :MOTION]
    ordinary = solve_scaled(motion.T @ motion, motion.T)
    instrumental = solve_scaled(instruments.T @ motion, instruments.T)
    noise = torque - motion @ (instrumental @ torque)
    terms = (ordinary[0] - instrumental[0]) * noise
    bounds = np.cumsum([0, *map(len, projection.signals)])
    sums = [
        terms[start : start + length].sum()
        for first, last in itertools.pairwise(bounds)
        for start in range(first, last - length + 1, length)
    ]
    variance = np.var(sums, ddof=1) * projection.rows / length
    quantile = special.stdtrit(len(sums) - 1, 1.0 - SIGNIFICANCE)
    margin = float(quantile * np.sqrt(variance))
    return float(terms.sum()) / projection.shrinkage, margin / projection.shrinkage


def path_bias(records: Sequence[Regressors]) -> float:
    """How far K of a model without a reflex is off, because intrinsic inputs and reflex torque are correlated.

    This is the bias of one-pass methods, which fit the intrinsic path first and the reflex to what it leaves. A PRBS
    correlates the two paths, short pulses do not.
    """
    stiffness = fit_stiffness(records)
    return 100.0 * (fit_stiffness(records, with_reflex=False) - stiffness) / abs(stiffness)


def fit_stiffness(records: Sequence[Regressors], *, with_reflex: bool = True) -> float:
    """K by least squares, on samples with all lags of the reflex, a finite response to the rectified velocity."""
    lags = round(REFLEX_LAGS * records[0].rate)
    inputs, torques = [], []
    for record in records:
        if record.torque.size <= lags + 1:
            continue
        columns = record.inputs[lags:, :MOTION]
        if with_reflex:
            reflex = lag_matrix(record.inputs[:, MOTION], 0, lags)
            columns = np.column_stack([columns, reflex])
        torque = record.torque[lags:]
        inputs.append(columns - columns.mean(axis=0))
        torques.append(torque - torque.mean())
    values = fit_scaled(np.concatenate(inputs), np.concatenate(torques), DISCARDED_SHARE)
    return float(values[0])


def check_loop(
    records: Sequence[Regressors], projection: ReferenceProjection | None
) -> tuple[str, Finding]:
    """Whether torque feeds back on the position; undecided without a projection on a usable reference."""
    if projection is None:
        text = (
            "undecided: this cannot be told without a usable reference. Methods for open loop hold only if it is "
            "open."
        )
        return "undecided", Finding("loop", "warning", text)
    try:
        test = feedback_test(records, projection)
    except DataError as error:
        return "undecided", Finding("loop", "warning", f"undecided: {error}")
    verdict = "warning" if test.loop == "undecided" else "ok"
    return test.loop, Finding("loop", verdict, _describe_loop(test))


def _describe_loop(test: FeedbackTest) -> str:
    """Outcome of the test in sentences."""
    text = (
        f"{test.loop}: the movement that the reference does not explain and the torque that the movement does not "
        f"explain have a mean squared coherence of {test.coherence:.2f} (p = {test.p_value:.2g})"
    )
    if test.loop == "closed":
        interval = f"{test.bias - test.margin:.3g} … {test.bias + test.margin:.3g}"
        return (
            f"{text}, and the torque does work on the load. By this K of a second-order model by least squares is off "
            f"by {test.bias:.3g} % (98 % interval {interval} %)."
        )
    if test.p_value < SIGNIFICANCE:
        text = f"{text}, but the torque does no work on the load"
    else:
        text = f"{text}, no more than chance"
    confidence = (
        f"{max(test.limit, SHOWN_BIAS):.2g} % (99 % confidence; {LARGEST_BIAS:g} % would matter)"
    )
    if test.loop == "open":
        return f"{text}. Whatever feedback there is biases K by least squares by less than {confidence}."
    return (
        f"{text}. But K by least squares may be off by as much as {confidence}: by {test.bias:.2g} ± {test.margin:.2g} "
        f"% in this record. About {test.sufficient_duration:.2g} s, or a stronger perturbation, would decide whether "
        "that is more than chance; if it is, torque feeds back or the position is noisy."
    )
