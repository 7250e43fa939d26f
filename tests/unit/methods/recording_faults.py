"""Faults of recordings, each with words that have to be in its warning."""

import numpy as np


def change(trial, **channels):
    return trial.assign({name: trial[name].copy(data=np.asarray(values)) for name, values in channels.items()})


def values(trial, *names):
    return [trial[name].values for name in names]


def clip(name, low, high):
    return lambda trial, rng: trial.assign({name: trial[name].clip(*trial[name].quantile([low, high]).values)})


def hold(*names):
    """The second half of some channels keeps one value."""

    def apply(trial, rng):
        half = trial.sizes["time"] // 2
        parts = {name: trial[name].values.copy() for name in names}
        for part in parts.values():
            part[half:] = part[half]
        return change(trial, **parts)

    return apply


def add_spike(name, size):
    """One sample, in standard deviations of the channel."""

    def apply(trial, rng):
        (x,) = values(trial, name)
        x = x.copy()
        x[rng.integers(2000, x.size - 2000)] += size * x.std()
        return change(trial, **{name: x})

    return apply


def sinusoid(trial, rng):
    t = np.arange(trial.sizes["time"]) / 1000.0
    omega = 2 * np.pi * 1.5
    position, velocity = 0.02 * np.sin(omega * t), 0.02 * omega * np.cos(omega * t)
    torque = 150 * position + 0.8 * velocity - 0.015 * omega**2 * position + 0.1 * rng.standard_normal(t.size)
    return change(trial, position=position, torque=torque)


def white_noise(trial, rng):
    size = trial.sizes["time"]
    return change(trial, position=0.002 * rng.standard_normal(size), torque=rng.standard_normal(size))


def exchange(trial, rng):
    """Position and torque exchanged, and small enough to be slow."""
    position, torque = values(trial, "position", "torque")
    smooth = np.convolve(torque, np.ones(200) / 200, mode="same")
    return change(trial, position=0.01 * smooth, torque=0.01 * position)


def exchange_reference(trial, rng):
    """Position and reference exchanged."""
    position, reference = values(trial, "position", "reference")
    return change(trial, position=reference, reference=position)


FAULTS = {
    "sign": (lambda trial, rng: trial.assign(torque=-trial["torque"]), "torque has the other sign"),
    "clipped torque": (clip("torque", 0.0, 0.8), "stand at the end of the range of the torque"),
    "torque clipped at both ends": (clip("torque", 0.1, 0.9), "stand at the end of the range of the torque"),
    "clipped position": (clip("position", 0.0, 0.8), "stand at the end of the range of the position"),
    "half of the torque": (hold("torque"), "of the torque keep one value"),
    "half of the position": (hold("position"), "of the position keep one value"),
    "half of all": (hold("position", "torque", "reference"), "of the torque keep one value"),
    "sinusoid": (sinusoid, "the movement excites 2 of"),
    "white noise": (white_noise, "% of the torque, as those of any other record would"),
    "another torque": (
        lambda trial, rng: change(trial, torque=np.roll(trial["torque"].values, 9876)),
        "as those of any",
    ),
    "spike of the torque": (add_spike("torque", 15.0), "the torque has a spike of about"),
    "spike of the position": (add_spike("position", 1.5), "the position has a spike of about"),
    "exchanged channels": (exchange, "are not those of a joint"),
    "exchanged reference": (exchange_reference, "the position is ahead of reference"),
}

REFERENCE_FAULTS = {
    "torque": (lambda trial, rng: change(trial, reference=trial["torque"]), "reference is the torque itself"),
    "scaled torque": (lambda trial, rng: change(trial, reference=2 - 0.01 * trial["torque"]), "is the torque itself"),
    "noise": (
        lambda trial, rng: change(trial, reference=rng.standard_normal(trial.sizes["time"])),
        "reference explains 0.0 % of the position .* too weak an instrument",
    ),
    "another reference": (
        lambda trial, rng: change(trial, reference=trial["reference"].values[::-1]),
        "too weak an instrument",
    ),
}

UNUSABLE = {
    "tiny torque": lambda trial: change(trial, torque=1e-100 * trial["torque"].values),
    "huge torque": lambda trial: change(trial, torque=1e100 * trial["torque"].values),
    "tiny position": lambda trial: change(trial, position=1e-100 * trial["position"].values),
    "torque out of band": lambda trial: change(trial, torque=np.sin(2.5 * np.arange(trial.sizes["time"]))),
    "position out of band": lambda trial: change(trial, position=1e-3 * np.sin(2.5 * np.arange(trial.sizes["time"]))),
    "three samples": lambda trial: trial.isel(time=slice(0, 3)),
}
