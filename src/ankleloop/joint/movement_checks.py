"""Whether the movement of a record, its torque and its reference can carry an estimate, from a few inner products."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from ankleloop.errors import DataError
from ankleloop.joint.findings import Finding
from ankleloop.joint.prepared import PreparedTrial
from ankleloop.joint.reference_projection import unseen_share
from ankleloop.joint.regressors import INTRINSIC_NAMES, Grid, Regressors
from ankleloop.kernels import kernel
from ankleloop.quantities import QUANTITIES
from ankleloop.signals.decimation import PASSBAND

__all__ = [
    "CERTAIN",
    "COPY",
    "MOTION",
    "MotionProducts",
    "check_excitation",
    "check_reference",
    "check_relation",
    "check_scale",
    "check_sign",
    "check_size",
    "fit_stiffness_by_instruments",
    "reference_correlations",
]

MOTION = len(INTRINSIC_NAMES)
SMALLEST, LARGEST = 1e-12, 1e12  # rad and N·m: squares of anything beyond leave the range of numbers
BAND_SHARE = 1e-3  # of the recorded deviation that decimation has to leave
LARGEST_POSITION = 1.0  # rad, standard deviation: no joint can move so far
STIFFNESSES = 0.1, 1e5  # N·m/rad, torque over position: from a finger to a leg that stands
MODEL = 0.2  # share of the torque that a second-order model must explain before its sign is read
# Share of the torque that it explains by chance: 1 s over the duration, within limits.
UNRELATED, UNRELATED_LIMITS = 1.0, (0.02, 0.1)
# Share of the position that leads and lags of an unrelated reference explain by chance, in the same way.
WEAK, WEAK_LIMITS = 5.0, (0.05, 0.15)
CERTAIN = 0.2  # share that a single lag explains: leads and lags together explain more than the weakest
LEAD, LAG = 0.02, 0.1  # s
COPY = 1e-6  # share of a channel that its copy leaves
TINY = np.finfo(float).tiny
DEPENDENT = 1e-12  # determinant of scaled equations, and singular value in units of the largest one
SAMPLED = 200  # samples, about, for a standard deviation


class MotionProducts:
    """Inner products of position, velocity, acceleration and torque of a record, each less its mean.

    Parameters
    ----------
    trial : PreparedTrial
        The trial.
    grid : Grid
        Its decimated samples.
    """

    def __init__(self, trial: PreparedTrial, grid: Grid) -> None:
        self.trial, self.grid = trial, grid
        signals = np.stack([*trial.motion(grid), trial.channel("torque", grid)])
        self.signals = signals - signals.mean(axis=1, keepdims=True)
        with np.errstate(over="ignore"):  # the scale is checked
            self.products = self.signals @ self.signals.T
        self.deviations = np.sqrt(np.diag(self.products) / grid.samples)

    @cached_property
    def stiffness(self) -> np.ndarray:
        """K, B and I of a model without a reflex by least squares, shape (3,)."""
        return _solve(self.products[:MOTION, :MOTION], self.products[:MOTION, MOTION])

    @property
    def explained(self) -> float:
        """Share of the torque's variance that this model explains."""
        return float(self.products[:MOTION, MOTION] @ self.stiffness / self.products[MOTION, MOTION])


def _solve(normal: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Solve equations whose unknowns differ in unit; what the data do not show is zero."""
    scale = 1.0 / np.sqrt(np.maximum(np.abs(np.diag(normal)), TINY))
    normal, right = normal * scale[:, None] * scale, right * scale
    if np.linalg.det(normal) > DEPENDENT:
        return scale * np.linalg.solve(normal, right)
    return scale * np.linalg.lstsq(normal, right, rcond=DEPENDENT)[0]


def check_scale(motion: MotionProducts) -> Finding:
    """Position and torque that can be computed with, and that lie within the band of the identification.

    Parameters
    ----------
    motion : MotionProducts
        Products of the record.

    Returns
    -------
    Finding
    """
    trial, (position, torque) = motion.trial, motion.deviations[[0, MOTION]]
    for name, deviation, unit in (("position", position, "rad"), ("torque", torque, "N·m")):
        if not SMALLEST < deviation < LARGEST:
            text = (
                f"the {name} has a standard deviation of {deviation:.3g} {unit}, and {SMALLEST:g} … {LARGEST:g} {unit} "
                "can be computed with: check its unit."
            )
            return Finding("scale", "refused", text)
        x = trial.samples(name)
        spread = x[:: max(1, x.size // SAMPLED)] - x[0]
        if deviation < BAND_SHARE * np.sqrt(spread @ spread / spread.size):
            highest = PASSBAND * trial.rate / motion.grid.factor
            text = f"the {name} has nothing below {highest:.3g} Hz, the band of the identification: raise its rate."
            return Finding("scale", "refused", text)
    return Finding("scale", "ok", f"standard deviations of {position:.3g} rad and {torque:.3g} N·m.")


def check_size(motion: MotionProducts) -> Finding:
    """Position and torque of a size that a joint can have, in rad and N·m.

    Parameters
    ----------
    motion : MotionProducts
        Products of the record.

    Returns
    -------
    Finding
    """
    position, torque = motion.deviations[[0, MOTION]]
    ratio = torque / position
    text = f"standard deviations of {position:.3g} rad and {torque:.3g} N·m, {ratio:.3g} N·m/rad"
    if position > LARGEST_POSITION or not STIFFNESSES[0] < ratio < STIFFNESSES[1]:
        text = (
            f"{text}, are not those of a joint: K, B, I and G are not either. Are position and torque exchanged, or in "
            "other units than rad and N·m?"
        )
        return Finding("size", "refused", text)
    return Finding("size", "ok", f"{text}.")


def fit_stiffness_by_instruments(
    motion: np.ndarray, torque: np.ndarray, instruments: np.ndarray
) -> tuple[np.ndarray, float]:
    """K, B and I of a model without a reflex, and the share of the torque that it explains.

    Parameters
    ----------
    motion : ndarray, shape (N, 3)
        Position, velocity and acceleration, less their means.
    torque : ndarray, shape (N,)
        Torque less its mean [N·m].
    instruments : ndarray, shape (N, 3)
        What the reference explains of the motion; the motion itself for least squares.

    Returns
    -------
    stiffness : ndarray, shape (3,)
        K [N·m/rad], B [N·m·s/rad], I [kg·m²].
    explained : float
    """
    scale = motion.std(axis=0)
    scaled, instruments = motion / scale, instruments / scale
    values = np.linalg.lstsq(instruments.T @ scaled, instruments.T @ torque, rcond=None)[0]
    return values / scale, float(1.0 - np.var(torque - scaled @ values) / np.var(torque))


def check_sign(stiffness: np.ndarray, explained: float) -> Finding:
    """Positive stiffness; by instruments in closed loop, where least squares can give a negative one by its bias.

    Parameters
    ----------
    stiffness : ndarray, shape (3,)
        K, B and I of a second-order model without a reflex.
    explained : float
        Share of the torque that this model explains.

    Returns
    -------
    Finding
    """
    values = dict(zip("KBI", stiffness, strict=True))
    numbers = ", ".join(f"{name} = {value:.3g} {QUANTITIES[name].unit}" for name, value in values.items())
    text = f"a second-order model without reflex has {numbers}"
    if values["K"] < 0 and (values["I"] < 0 or explained > MODEL):
        return Finding(
            "sign of the torque",
            "refused",
            f"{text}: the torque has the other sign. Set torque_sign: -1 (turn round the torque, not the position: the "
            "rectifier would see the wrong half).",
        )
    return Finding("sign of the torque", "ok", f"{text}: the torque opposes stretch.")


def check_relation(motion: MotionProducts) -> Finding:
    """Torque that has something to do with the movement.

    Parameters
    ----------
    motion : MotionProducts
        Products of the record.

    Returns
    -------
    Finding
    """
    text = f"position, velocity and acceleration explain {100.0 * motion.explained:.2g} % of the torque"
    duration = motion.trial.samples("time").size / motion.trial.rate
    if motion.explained < np.clip(UNRELATED / duration, *UNRELATED_LIMITS):
        text = (
            f"{text}, as those of any other record would: K, B, I and G say nothing about the joint. Check the "
            "channels and the perturbation."
        )
        return Finding("relation", "refused", text)
    return Finding("relation", "ok", f"{text}.")


def check_excitation(velocities: Sequence[np.ndarray], order: int, block_rows: int) -> Finding:
    """Rank of the velocity's Hankel matrix: a movement of q sinusoids is exciting of order 2 q.

    Parameters
    ----------
    velocities : sequence of ndarray, shape (N,)
        Velocity at the identification rate [rad/s] of a record, or of several that are merged.
    order, block_rows : int
        Largest order and block rows that a subspace method will use.

    Returns
    -------
    Finding
    """
    rows = 2 * block_rows + order
    samples = max(velocity.size for velocity in velocities)
    if samples < 2 * rows:
        text = f"{samples} samples are too few for {block_rows} block rows and order {order}: take fewer block rows."
        return Finding("excitation", "refused", text)
    products = np.zeros((rows, rows))
    for velocity in velocities:
        if velocity.size >= rows:
            first = np.correlate(velocity, velocity[: velocity.size - rows + 1], mode="valid")
            products += _displace(first, np.ascontiguousarray(velocity))
    values = np.linalg.eigvalsh(products)[::-1]
    rank = int(np.count_nonzero(values > 1e-6 * values[0]))
    # Decimation leaves the uppermost part of the band empty, which limits the rank of any movement.
    attainable = int(np.floor(2 * PASSBAND * rows))
    if rank < attainable:
        return Finding(
            "excitation",
            "refused" if rank < 2 * (order + 3) else "warning",
            f"the movement excites {rank} of {attainable} directions that {block_rows} block rows and order {order} "
            "need: perturb with a pseudorandom sequence, or take fewer block rows.",
        )
    return Finding("excitation", "ok", f"persistent for order {order} and {block_rows} block rows.")


@kernel()
def _displace(first, x):
    """Products of all rows of a Hankel matrix with each other, from those of its first row.

    As in `ankleloop.subspace.hankel_gram`, whose overhead and means are left out.
    """
    rows = first.size
    columns = x.size - rows + 1
    products = np.empty((rows, rows))
    products[0] = first
    products[:, 0] = first
    for i in range(rows - 1):
        for j in range(i, rows - 1):
            value = products[i, j] + x[i + columns] * x[j + columns] - x[i] * x[j]
            products[i + 1, j + 1] = value
            products[j + 1, i + 1] = value
    return products


def check_reference(records: Sequence[Regressors]) -> Finding:
    """Whether the reference can serve as an instrument.

    Parameters
    ----------
    records : sequence of Regressors
        Records of one joint, with their references.

    Returns
    -------
    Finding
        Refused where it explains nothing of the position, or is the torque; a warning where too short records do not
        tell.
    """
    name = records[0].reference_name
    try:
        share = unseen_share(records)
    except DataError as error:
        return Finding("reference", "warning", f"what {name} explains of the position cannot be told: {error}")
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


def reference_correlations(motion: MotionProducts, reference: np.ndarray) -> tuple[float, float, float]:
    """Squared correlations of the reference: the largest with the position a little later, and those at once.

    Parameters
    ----------
    motion : MotionProducts
        Products of the record.
    reference : ndarray, shape (N,)
        Reference on the same samples.

    Returns
    -------
    later : float
        The largest one with the position from 20 ms before to 100 ms after the reference: a bound for the share of the
        position that leads and lags explain together.
    position, torque : float
        Those with the position and with the torque at the same time.
    """
    rate = motion.trial.rate / motion.grid.factor
    reference = reference - reference.mean()
    lead, lag = round(LEAD * rate), round(LAG * rate)
    count = reference.size - lead - lag
    if count < 2:
        return 0.0, 0.0, 0.0
    window = reference[lead : lead + count]
    energies = float(reference @ reference) * np.diag(motion.products)[[0, MOTION]]
    products = np.correlate(motion.signals[0], window, mode="valid")
    position, torque = (motion.signals[[0, MOTION]] @ reference) ** 2 / energies
    return float(np.max(products**2) / energies[0]), float(position), float(torque)
