"""Whether the movement of a record, its torque and its reference can carry an estimate, from a few inner products."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, sqrt

import numpy as np

from ankleloop.checks.channels import CHANNEL_UNITS
from ankleloop.checks.findings import Finding
from ankleloop.errors import DataError
from ankleloop.joint.prepared import PreparedTrial, once
from ankleloop.joint.regressors import MOTION, Grid, Regressors
from ankleloop.quantities import QUANTITIES
from ankleloop.signals.decimation import PASSBAND
from ankleloop.signals.least_squares import solve_scaled
from ankleloop.signals.responses import project_on_reference, unseen_share
from ankleloop.signals.spectra import coherence, segment_spectra
from ankleloop.subspace.hankel import hankel_gram
from ankleloop.trials.trial import REQUIRED

SMALLEST, LARGEST = (
    1e-12,
    1e12,
)  # rad and N·m: squares of anything beyond leave the range of numbers
BAND_SHARE = 1e-3  # of the recorded deviation that decimation has to leave
LARGEST_POSITION = 1.0  # rad, standard deviation: no joint can move so far
STIFFNESSES = 0.1, 1e5  # N·m/rad, torque over position: from a finger to a leg that stands
MODEL = 0.2  # share of the torque that a second-order model must explain before its sign is read
# Share of the torque that it explains by chance: 1 s over the duration, within limits.
UNRELATED, UNRELATED_LIMITS = 1.0, (0.02, 0.1)
# Share of the position that leads and lags of an unrelated reference explain by chance, in the same way.
WEAK, WEAK_LIMITS = 5.0, (0.05, 0.15)
CERTAIN = (
    0.2  # share that a single lag explains: leads and lags together explain more than the weakest
)
LEAD, LAG = 0.02, 0.1  # s
FAST_RATE = 1000.0  # Hz: at half of it nothing is left of a torque
EDGE, EDGE_SLOPE = (
    2.5e-4,
    0.63,
)  # density at the edge of the band over the largest one, and over that at three quarters
NOISE_BAND = 45.0  # Hz
NOISE_SHARE = 0.15  # of the velocity's power: from about there on the reflex gain is off by 15 %
NOISE_SEGMENT, NOISE_SEGMENTS = (
    0.5,
    30,
)  # s, and about how many of them show the noise of a long record
COPY = 1e-6  # share of a channel that its copy leaves
TINY = np.finfo(float).tiny
EXCITED = 1e-6  # of the largest eigenvalue of the velocity's Hankel products
SAMPLED = 200  # samples, about, for a standard deviation; an odd number apart, which few frequencies divide


@dataclass(frozen=True, eq=False)
class MotionProducts:
    """Inner products of position, velocity, acceleration and torque of the decimated samples of a record."""

    grid: Grid  # its decimated samples
    signals: (
        np.ndarray
    )  # shape (4, N): position, velocity, acceleration and torque, each less its mean
    products: np.ndarray  # shape (4, 4): their inner products
    # Shape (3,): K, B and I of a model without a reflex by least squares.
    stiffness: np.ndarray
    explained: float  # share of the torque's variance that this model explains
    deviations: tuple[float, float]  # standard deviations of position and torque


@once
def motion_products(trial: PreparedTrial, grid: Grid) -> MotionProducts:
    """Products of a trial."""
    signals, products, stiffness, explained = regress_torque(
        [*trial.motion(grid), trial.channel("torque", grid)]
    )
    position, *_, torque = np.sqrt(products.diagonal() / grid.samples).tolist()
    return MotionProducts(grid, signals, products, stiffness, explained, (position, torque))


def regress_torque(
    signals: Sequence[np.ndarray],
) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """Least squares of the last signal, the torque, on the others, which differ in unit; what is not shown is zero.

    Shapes: signals (N,); returns the signals less their means (n + 1, N), their products (n + 1, n + 1), coefficients
    (n,), and the share of the variance that they explain.
    """
    deviations = np.stack([x - x.mean() for x in signals])
    products = deviations @ deviations.T
    right = products[:-1, -1]
    values = solve_scaled(products[:-1, :-1], right)
    return deviations, products, values, float(right @ values / products[-1, -1])


def check_scale(trial: PreparedTrial, motion: MotionProducts) -> Finding:
    """Position and torque that can be computed with, and that lie within the band of the identification."""
    position, torque = motion.deviations
    for name, deviation in zip(REQUIRED, motion.deviations, strict=True):
        if not SMALLEST < deviation < LARGEST:
            unit = CHANNEL_UNITS[name]
            text = (
                f"the {name} has a standard deviation of {deviation:.3g} {unit}, and {SMALLEST:g} … {LARGEST:g} {unit} "
                "can be computed with: check its unit."
            )
            return Finding("scale", "refused", text)
        x = trial.samples[name]
        if deviation < BAND_SHARE * sqrt(np.mean((x[:: x.size // SAMPLED | 1] - x[0]) ** 2)):
            highest = PASSBAND * trial.rate / motion.grid.factor
            text = f"the {name} has nothing below {highest:.3g} Hz, the band of the identification: raise its rate."
            return Finding("scale", "refused", text)
    return Finding(
        "scale", "ok", f"standard deviations of {position:.3g} rad and {torque:.3g} N·m."
    )


def check_size(_: PreparedTrial, motion: MotionProducts) -> Finding:
    """Position and torque of a size that a joint can have, in rad and N·m."""
    position, torque = motion.deviations
    ratio = torque / position if position > 0.0 else inf
    text = f"standard deviations of {position:.3g} rad and {torque:.3g} N·m, {ratio:.3g} N·m/rad"
    if not (
        position <= LARGEST_POSITION
        and STIFFNESSES[0] * position < torque < STIFFNESSES[1] * position
    ):
        text = (
            f"{text}, are not those of a joint: K, B, I and G are not either. Are position and torque exchanged, or in "
            "other units than rad and N·m?"
        )
        return Finding("size", "refused", text)
    return Finding("size", "ok", f"{text}.")


def check_sign(stiffness: np.ndarray, explained: float) -> Finding:
    """Positive stiffness; by instruments in closed loop, where least squares can give a negative one by its bias.

    Shapes: stiffness (3,).
    """
    values = dict(zip("KBI", stiffness.tolist(), strict=True))
    numbers = ", ".join(
        f"{name} = {value:.3g} {QUANTITIES[name].unit}" for name, value in values.items()
    )
    text = f"a second-order model without reflex has {numbers}"
    if stiffness[0] < 0 and (stiffness[2] < 0 or explained > MODEL):
        return Finding(
            "sign of the torque",
            "refused",
            f"{text}: the torque has the other sign. Set torque_sign: -1 (turn round the torque, not the position: the "
            "rectifier would see the wrong half).",
        )
    return Finding("sign of the torque", "ok", f"{text}: the torque opposes stretch.")


def check_signs_by_reference(records: Sequence[Regressors]) -> list[Finding]:
    """Sign of the torque of each record by what the reference explains, which fed-back torque does not bias."""
    channels = [np.column_stack([record.inputs[:, :MOTION], record.torque]) for record in records]
    references = [record.reference for record in records if record.reference is not None]
    projection = project_on_reference(references, channels, records[0].rate)
    findings = []
    for x, residual in zip(projection.signals, projection.residuals, strict=True):
        scale, torque = x[:, :MOTION].std(axis=0), x[:, MOTION]
        motion, instruments = x[:, :MOTION] / scale, (x - residual)[:, :MOTION] / scale
        values = np.linalg.lstsq(instruments.T @ motion, instruments.T @ torque, rcond=None)[0]
        findings.append(
            check_sign(
                values / scale, 1.0 - float(np.var(torque - motion @ values) / np.var(torque))
            )
        )
    return findings


@once
def check_velocity(trial: PreparedTrial, delay: float) -> Finding:
    """Noise of the position, which reaches the rectified velocity: power above the band that the torque does not share.

    A movement of any frequency comes with the torque of the inertia; hum and noise of the position do not.
    """
    ok = Finding("velocity", "ok", "its power is that of a movement.")
    velocity = trial.velocity(delay)
    length = round(NOISE_SEGMENT * trial.rate)
    if velocity.size < 10 * length or trial.rate < 2.5 * NOISE_BAND:
        return ok
    signals = velocity, trial.samples["torque"]
    step = max(length // 2, velocity.size // NOISE_SEGMENTS)
    v, t = (segment_spectra(signal, length, step) for signal in signals)
    power = np.mean(np.abs(v) ** 2, axis=0)
    above = np.arange(power.size) * trial.rate / length > NOISE_BAND
    share = float(np.sum((power * (1.0 - coherence(v, t)))[above]) / np.sum(power))
    if share < NOISE_SHARE:
        return ok
    text = (
        f"{100 * share:.2g} % of the power of the velocity lie above {NOISE_BAND:g} Hz and have nothing to do with the "
        "torque: noise or hum of the position. The reflex answers the velocity that is recorded, so G is too large. "
        "Record the position with less noise, or filter it and all other channels alike."
    )
    return Finding("velocity", "warning", text)


@once
def check_bandwidth(trial: PreparedTrial) -> Finding:
    """Torque that was sampled without a filter: its spectrum goes on, flat, to half of the sampling rate.

    What lies beyond appears at other frequencies, where the model takes it for torque of the movement.
    """
    ok = Finding("bandwidth", "ok", "the torque was sampled fast enough.")
    length = 2 * round(trial.rate)
    torque = trial.samples["torque"]
    if trial.rate >= FAST_RATE or torque.size < 5 * length:
        return ok
    density = np.mean(np.abs(segment_spectra(torque, length, length // 2)) ** 2, axis=0)
    place = np.linspace(0.0, 1.0, density.size)  # of half of the sampling rate
    edge, inside = (
        float(density[(place >= low) & (place < high)].mean())
        for low, high in ((0.94, 0.995), (0.7, 0.8))
    )
    if edge < EDGE * float(density[place < 0.3].max()) or edge < EDGE_SLOPE * inside:
        return ok
    text = (
        f"the spectrum of the torque does not fall towards {trial.rate / 2:g} Hz, half of its rate: samples were "
        "left out without a filter, and what lies beyond appears within the band. I and B are too small. Filter before "
        "samples are left out (scipy.signal.decimate), or record at a higher rate."
    )
    return Finding("bandwidth", "warning", text)


def check_relation(trial: PreparedTrial, motion: MotionProducts) -> Finding:
    """Torque that has something to do with the movement."""
    text = f"position, velocity and acceleration explain {100.0 * motion.explained:.2g} % of the torque"
    by_chance = float(np.clip(UNRELATED * trial.rate / trial.time.size, *UNRELATED_LIMITS))
    if not motion.explained >= by_chance:
        text = (
            f"{text}, as those of any other record would: K, B, I and G say nothing about the joint. Check the "
            "channels and the perturbation."
        )
        return Finding("relation", "refused", text)
    return Finding("relation", "ok", f"{text}.")


def check_excitation(velocities: Sequence[np.ndarray], order: int, block_rows: int) -> Finding:
    """Rank of the velocity's Hankel matrix: a movement of q sinusoids is exciting of order 2 q.

    Shapes: velocities (N,).
    """
    rows = 2 * block_rows + order
    samples = max(map(len, velocities))
    if samples < 2 * rows:
        text = f"{samples} samples are too few for {block_rows} block rows and order {order}: take fewer block rows."
        return Finding("excitation", "refused", text)
    # Decimation leaves the uppermost part of the band empty, which limits the rank of any movement.
    attainable = int(np.floor(2 * PASSBAND * rows))
    grams = [
        hankel_gram([velocity[:, None]], rows, subtract_means=False) for velocity in velocities
    ]
    values = np.linalg.eigvalsh(np.sum(grams, axis=0))[::-1]
    rank = int(np.count_nonzero(values > EXCITED * values[0]))
    if rank < attainable:
        return Finding(
            "excitation",
            "refused" if rank < 2 * (order + 3) else "warning",
            f"the movement excites {rank} of {attainable} directions that {block_rows} block rows and order {order} "
            "need: perturb with a pseudorandom sequence, or take fewer block rows.",
        )
    return Finding("excitation", "ok", f"persistent for order {order} and {block_rows} block rows.")


def check_reference(records: Sequence[Regressors]) -> Finding:
    """Whether the reference can serve as an instrument."""
    name = records[0].reference_name
    try:
        references = [record.reference for record in records if record.reference is not None]
        share = unseen_share(
            references, [record.inputs[:, 0] for record in records], records[0].rate
        )
    except DataError as error:
        return Finding(
            "reference", "warning", f"what {name} explains of the position cannot be told: {error}"
        )
    text = f"{name} explains {100 * max(share, 0.0):.1f} % of the position in unseen halves"
    duration = sum(record.torque.size for record in records) / records[0].rate
    limit = float(np.clip(WEAK / duration, *WEAK_LIMITS))
    if share < limit:
        text = (
            f"{text}, and chance alone up to {100 * limit:.2g} % in {duration:.3g} s: it is too weak an instrument. "
            "Is it the command of the servo? Give that as reference; reference='position' is for records in open loop."
        )
        return Finding("reference", "refused", text)
    return Finding("reference", "ok", f"{text}.")


@once
def reference_correlations(
    trial: PreparedTrial, grid: Grid, name: str
) -> tuple[float, float, float]:
    """Squared correlations of the reference: the largest with the position a little later, and those at once."""
    motion, reference = motion_products(trial, grid), trial.channel(name, grid)
    rate = trial.rate / grid.factor
    lead, lag = round(LEAD * rate), round(LAG * rate)
    if reference.size - lead - lag < 2:
        return 0.0, 0.0, 0.0
    reference = reference - reference.mean()
    position, *_, torque = motion.signals
    energy = float(reference @ reference)
    energies = energy * motion.products.diagonal()[[0, MOTION]]
    at_once = np.array([reference @ position, reference @ torque]) ** 2 / energies
    shifted = np.correlate(position, reference[lead : reference.size - lag], mode="valid")
    return float(np.max(shifted**2) / energies[0]), float(at_once[0]), float(at_once[1])
