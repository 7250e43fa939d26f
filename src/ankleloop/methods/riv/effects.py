"""Effects of a subject, a joint or an instrument that the models of `riv` and `riv-tv` do not have."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

REACTION_LATENCIES = (0.12, 0.16, 0.2, 0.25)  # s
REACTION_LAG = 0.03  # s, time constant of the muscle
THRESHOLD_SHARE = 0.5  # of the standard deviation of the velocity: the threshold for which its derivative is taken


@dataclass(frozen=True, eq=False)
class Channels:
    """Signals that effects are made of: those that were measured, or those that the reference predicts."""

    position: np.ndarray  # over time, less its mean
    velocity: np.ndarray  # over time
    motion: np.ndarray  # spectra of both
    torque: np.ndarray  # spectrum, less the effect so far
    recorded: np.ndarray  # spectrum of the torque as it was recorded
    rectified: np.ndarray  # spectrum of the rectified velocity, delayed
    reference: np.ndarray  # spectrum
    response: np.ndarray  # of the reflex dynamics
    gain: float  # of the reflex [N·m·s/rad]
    delay: float  # of the reflex [s]
    s: np.ndarray  # Laplace variable [rad/s], not zero
    transform: Callable[[np.ndarray], np.ndarray]  # spectra of signals
    signals: Callable[[np.ndarray], np.ndarray]  # signals of spectra


@dataclass(frozen=True)
class Effect:
    """An effect in words, and the derivative of the torque with respect to its size."""

    describe: Callable[[Any], str]  # what it is called with its size
    advice: str  # what to do
    # Shape (sizes, frequencies) or (frequencies,); None for an effect that is an unknown of the equations.
    differentiate: Callable[[Channels], np.ndarray] | None = None
    rounds: int = 3  # fits of its size
    one_sided: bool = False  # the opposite is no effect of an instrument
    lookalikes: tuple[str, ...] = ()  # causes that the sampled channels do not tell from it

    def rows(self, channels: Channels) -> np.ndarray:
        """Derivatives of the torque with respect to the sizes, shape (sizes, frequencies)."""
        assert self.differentiate is not None
        return np.atleast_2d(self.differentiate(channels))


def _describe_lag(size: float) -> str:
    order = "after" if size > 0.0 else "before"
    return f"a torque recorded {1e3 * abs(size):.2g} ms {order} the position"


def _describe_reaction(sizes: np.ndarray) -> str:
    total = np.sum(sizes)
    strongest = np.maximum(np.sign(total) * sizes, 0.0)
    latency = np.average(REACTION_LATENCIES, weights=strongest)
    order = "against" if total > 0.0 else "with"
    return f"a reaction of the subject {1e3 * latency:.0f} ms after the movement, {abs(total):.2g} N·m/rad {order} it"


def _describe_bend(size: float) -> str:
    if size > 0.0:
        return (
            "a stiffness that grows with the stretch, or a position that is flat where it is large,"
        )
    return "a stiffness that falls with the stretch, or a torque that is flat where it is large,"


def _react(channels: Channels) -> np.ndarray:
    late = np.exp(-np.multiply.outer(REACTION_LATENCIES, channels.s))
    return late * channels.motion[0] / (1.0 + REACTION_LAG * channels.s)


def _cube(x: np.ndarray) -> np.ndarray:
    """Third power; ``x**3`` takes a logarithm of each sample."""
    return x * x * x


def _flatten(channels: Channels) -> np.ndarray:
    """A cube is but the direction of a saturation."""
    return -channels.transform(_cube(channels.signals(channels.recorded)))


def _turn(channels: Channels) -> np.ndarray:
    late = np.exp(-channels.s * channels.delay)
    return channels.response * (channels.rectified - late * channels.motion[1])


def _lose_below_threshold(channels: Channels) -> np.ndarray:
    """Reflex torque that velocities up to a threshold would have, over the threshold."""
    threshold = THRESHOLD_SHARE * np.std(channels.velocity)
    lost = channels.transform(np.clip(channels.velocity, 0.0, threshold))
    late = np.exp(-channels.s * channels.delay)
    return -channels.gain / threshold * channels.response * late * lost


EFFECTS: dict[str, Effect] = {
    "delay": Effect(
        lambda size: f"a reflex delay of {1e3 * size:.3g} ms",
        "give no delay, so that it is estimated",
    ),
    "pole": Effect(lambda size: f"a third pole of the reflex at {size:.3g} rad/s", "take order=3"),
    "torque_lag": Effect(
        _describe_lag,
        "record both through equal filters",
        lambda channels: -channels.s * channels.torque,
        lookalikes=(
            "a low-pass of one channel alone",
            "no filter before sampling",
            "a compliance between joint and sensor",
            "a resonance of the fixture",
        ),
    ),
    "high-pass": Effect(
        lambda size: f"a high-pass of {0.5 / np.pi * size:.2g} Hz in the torque",
        "record without AC coupling or removal of drift",
        lambda channels: -channels.recorded / channels.s,
        one_sided=True,
    ),
    "friction": Effect(
        lambda size: f"a friction of {size:.2g} N·m",
        "record the device without a subject, identify it (ankleloop identify EMPTY --method apparatus), and subtract "
        "it (--apparatus FILE)",
        lambda channels: channels.transform(np.sign(channels.velocity)),
        one_sided=True,
    ),
    "compression": Effect(
        lambda size: "a torque that is flat where it is large",
        "widen the range of the torque sensor",
        _flatten,
        one_sided=True,
        rounds=1,
    ),
    "bend": Effect(
        _describe_bend,
        "look whether a sensor is at the end of its range; else perturb less",
        lambda channels: channels.transform(_cube(channels.position)),
    ),
    "drag": Effect(
        lambda size: "a viscosity that grows with the velocity",
        "B is that of the velocities of this record: compare only records with the same perturbation",
        lambda channels: channels.transform(channels.velocity * np.abs(channels.velocity)),
        one_sided=True,
    ),
    "reaction": Effect(
        _describe_reaction,
        "ask the subject not to intervene, and take a perturbation that cannot be foreseen",
        _react,
    ),
    "crosstalk": Effect(
        lambda size: f"a crosstalk of the command in the torque of {size:.3g} N·m/rad",
        "separate the cables of the command and of the torque, or their grounds",
        lambda channels: channels.reference,
    ),
    "threshold": Effect(
        lambda size: f"a threshold of the reflex of about {size:.2g} rad/s",
        'take basis="spline", which estimates it',
        _lose_below_threshold,
        one_sided=True,
    ),
    "together": Effect(
        lambda sizes: "a mixture of effects, none of which the record shows by itself,",
        "look at the range of both sensors, at friction and crosstalk, and at what the subject was told",
        one_sided=True,
    ),
    "direction": Effect(
        lambda size: f"a reflex gain of {size:.3g} N·m·s/rad in the other direction",
        "if the axis is turned round, give position_sign={position_sign}, torque_sign={torque_sign} to read_trial",
        _turn,
    ),
}


def list_effects(*, open_loop: bool, passive: bool) -> list[str]:
    """Names of the effects that channels can show; where the position is the reference, its crosstalk is stiffness."""
    names = [name for name, effect in EFFECTS.items() if effect.differentiate is not None]
    if open_loop:
        names.remove("crosstalk")
    if passive:
        names.remove("threshold")
    return names
