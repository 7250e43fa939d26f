"""Parameters of the simulated experiment, each with its unit, default and bounds.

Defaults are those of Zhao, Ludvig and Kearney (ACC 2008) where the paper gives them. What it does not give (load,
actuator, recorder, level of voluntary torque, reflex gain of its Table 1) is an assumption, marked as such.
"""

from dataclasses import dataclass, field, fields
from numbers import Real

import numpy as np

__all__ = [
    "Actuator",
    "Disturbances",
    "Intrinsic",
    "Load",
    "Perturbation",
    "Recorder",
    "Reflex",
    "Run",
    "Simulation",
    "parameter_table",
]

KINDS = ("prbs", "pulses")


def _parameter(default, unit, description, low=None, high=None, *, above=None, optional=False, choices=None):
    metadata = {
        "unit": unit,
        "description": description,
        "minimum": low,
        "maximum": high,
        "exclusiveMinimum": above,
        "optional": optional,
        "choices": choices,
    }
    return field(default=default, metadata=metadata)


class _Checked:
    """Refuse values outside the declared bounds, naming the parameter."""

    def __post_init__(self):
        for item in fields(self):
            _check(item, getattr(self, item.name))


def _check(item, value):
    meta, name = item.metadata, item.name
    if isinstance(item.default, bool):
        if not isinstance(value, (bool, np.bool_)):
            raise ValueError(f"{name} must be true or false, got {value!r}.")
        return
    if meta["choices"] is not None:
        if value not in meta["choices"]:
            raise ValueError(f"{name} must be one of {', '.join(meta['choices'])}; got {value!r}.")
        return
    if value is None and meta["optional"]:
        return
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, Real) or not np.isfinite(value):
        raise ValueError(f"{name} must be a finite number [{meta['unit']}], got {value!r}.")
    for bound, holds, word in (
        (meta["minimum"], lambda b: value >= b, "at least"),
        (meta["maximum"], lambda b: value <= b, "at most"),
        (meta["exclusiveMinimum"], lambda b: value > b, "above"),
    ):
        if bound is not None and not holds(bound):
            raise ValueError(f"{name} must be {word} {bound} {meta['unit']}, got {value!r}.")


@dataclass(frozen=True)
class Intrinsic(_Checked):
    """Intrinsic stiffness (Eq. 16): TQ_I = K·P + B·Ṗ + I·P̈."""

    stiffness: float = _parameter(150.0, "N·m/rad", "intrinsic elastic stiffness K", 0)
    viscosity: float = _parameter(0.8, "N·m·s/rad", "intrinsic viscosity B", 0)
    inertia: float = _parameter(0.015, "kg·m²", "intrinsic inertia I", 0)


@dataclass(frozen=True)
class Reflex(_Checked):
    """Reflex stiffness (Eq. 2, 17): delayed velocity, half-wave rectified, through a low-pass of order 2 or 3."""

    reflex_gain: float = _parameter(
        13.0, "N·m·s/rad", "reflex gain G; assumed: Eq. 17 as printed is 2, which cannot give Table 1", 0
    )
    omega_n: float = _parameter(40.0, "rad/s", "natural frequency of the reflex low-pass", above=0)
    zeta: float = _parameter(1.0, "1", "damping ratio of the reflex low-pass", above=0)
    delay: float = _parameter(0.040, "s", "reflex delay; at least one recorded sample", above=0)
    pole: float | None = _parameter(
        None, "rad/s", "extra real pole p of the third-order form (Eq. 2); null: second order", above=0, optional=True
    )


@dataclass(frozen=True)
class Load(_Checked):
    """Impedance-controlled load H_imp(s) = 1 / (I_L s² + B_L s + K_L); assumed, the paper gives none."""

    load_inertia: float = _parameter(1.1, "kg·m²", "inertia I_L of the simulated load; assumed", above=0)
    load_viscosity: float = _parameter(7.1, "N·m·s/rad", "viscosity B_L of the simulated load; assumed", 0)
    load_stiffness: float = _parameter(250.0, "N·m/rad", "stiffness K_L of the simulated load; assumed", 0)


@dataclass(frozen=True)
class Actuator(_Checked):
    """Position servo between the command and the joint, second order; assumed."""

    actuator_frequency: float = _parameter(20.0, "Hz", "natural frequency of the servo; assumed", above=0)
    actuator_damping: float = _parameter(0.8, "1", "damping ratio of the servo; assumed", above=0)


@dataclass(frozen=True)
class Perturbation(_Checked):
    """Position command, the reference: a pseudorandom binary sequence, or short pulses."""

    perturbation: str = _parameter(
        "prbs", "1", "kind of the position command: pseudorandom binary sequence, or short pulses", choices=KINDS
    )
    amplitude: float = _parameter(0.04, "rad", "peak-to-peak amplitude of the position command", above=0)
    switching_interval: float = _parameter(
        0.1, "s", "interval at whose multiples the PRBS may switch, or a pulse may begin", above=0
    )
    pulse_length: float = _parameter(
        0.02, "s", "length of the pulses; well below the delay, it decorrelates the two paths", above=0
    )


@dataclass(frozen=True)
class Disturbances(_Checked):
    """Voluntary torque and measurement noise; both are fed back through the load."""

    voluntary: float = _parameter(
        0.05, "1", "standard deviation of the voluntary torque over that of the clean net torque; assumed", 0
    )
    voluntary_cutoff: float = _parameter(2.0, "Hz", "-3 dB frequency of its second-order Bessel low-pass", above=0)
    snr_db: float | None = _parameter(
        10.0,
        "dB",
        "clean net torque over measurement noise, in the recorded signal; null: no noise",
        -100,
        300,
        optional=True,
    )
    noise_rate: float = _parameter(100.0, "Hz", "rate at which white measurement noise is drawn and held", above=0)


@dataclass(frozen=True)
class Recorder(_Checked):
    """Anti-aliasing filter and sampler, the same on every channel."""

    recording_rate: float = _parameter(1000.0, "Hz", "sampling rate of the record", above=0)
    antialias_cutoff: float = _parameter(
        200.0, "Hz", "-3 dB frequency of the fourth-order Bessel anti-aliasing filter; assumed", above=0
    )


@dataclass(frozen=True)
class Run(_Checked):
    """Length of the run, and whether the loop is closed."""

    duration: float = _parameter(50.0, "s", "length of the record", above=0)
    settling: float = _parameter(5.0, "s", "time simulated ahead of the record, and dropped", 0)
    integration_rate: float = _parameter(10000.0, "Hz", "rate of the exact discretisation of the loop", above=0)
    closed_loop: bool = _parameter(True, "1", "false: stiff servo, torque does not move the joint")
    position_limit: float = _parameter(1.0, "rad", "a loop that leaves ± this is declared unstable", above=0)


@dataclass(frozen=True)
class Simulation:
    """All parameters of a simulated experiment, in groups.

    Parameters
    ----------
    intrinsic, reflex, load, actuator, perturbation, disturbances, recorder, run
        The groups; each is a frozen dataclass of its own with documented fields.

    Examples
    --------
    >>> Simulation.from_flat(reflex_gain=20.0).reflex.reflex_gain
    20.0
    >>> Simulation().load
    Load(load_inertia=1.1, load_viscosity=7.1, load_stiffness=250.0)
    """

    intrinsic: Intrinsic = field(default_factory=Intrinsic)
    reflex: Reflex = field(default_factory=Reflex)
    load: Load = field(default_factory=Load)
    actuator: Actuator = field(default_factory=Actuator)
    perturbation: Perturbation = field(default_factory=Perturbation)
    disturbances: Disturbances = field(default_factory=Disturbances)
    recorder: Recorder = field(default_factory=Recorder)
    run: Run = field(default_factory=Run)

    def __post_init__(self):
        self._check_grids()

    @classmethod
    def from_flat(cls, **parameters):
        """Build from parameters by name, whichever group they belong to.

        Parameters
        ----------
        **parameters
            Any names of `parameter_table`.

        Returns
        -------
        Simulation

        Raises
        ------
        TypeError
            For a name that no group has.
        ValueError
            For a value outside its bounds.
        """
        unknown = sorted(set(parameters) - set(parameter_table()))
        if unknown:
            raise TypeError(f"unknown simulation parameter {unknown[0]!r}; known: {', '.join(parameter_table())}.")
        groups = {}
        for group in fields(cls):
            names = {item.name for item in fields(group.default_factory)}
            groups[group.name] = group.default_factory(**{k: v for k, v in parameters.items() if k in names})
        return cls(**groups)

    def flat(self):
        """All parameters by name.

        Returns
        -------
        dict
        """
        return {
            item.name: getattr(getattr(self, group.name), item.name)
            for group in fields(self)
            for item in fields(group.default_factory)
        }

    def _check_grids(self):
        """Everything that is held or switched has to fall on recorded samples."""
        rate = self.recorder.recording_rate
        for name, ratio in (
            ("duration × recording_rate", self.run.duration * rate),
            ("settling × recording_rate", self.run.settling * rate),
            ("switching_interval × recording_rate", self.perturbation.switching_interval * rate),
            ("pulse_length × recording_rate", self.perturbation.pulse_length * rate),
            ("recording_rate / noise_rate", rate / self.disturbances.noise_rate),
            ("integration_rate / recording_rate", self.run.integration_rate / rate),
        ):
            if abs(ratio - round(ratio)) > 1e-6 or (round(ratio) < 1 and not name.startswith("settling")):
                raise ValueError(f"{name} must be a whole number, got {ratio:g}.")
        if self.disturbances.voluntary_cutoff >= rate / 2:
            raise ValueError(
                f"voluntary_cutoff must be below half of the recording_rate ({rate / 2:g} Hz), got "
                f"{self.disturbances.voluntary_cutoff!r} Hz."
            )
        if self.reflex.delay * rate < 1 - 1e-9:
            raise ValueError(
                f"delay must be at least one recorded sample ({1 / rate:g} s), got {self.reflex.delay!r} s."
            )


def parameter_table():
    """Every simulation parameter with its default, unit, description and bounds.

    Returns
    -------
    dict of str to dict
        Keys `default`, `unit`, `description`, `minimum`, `maximum`, `exclusiveMinimum`, `optional`, `choices`, by
        parameter.

    Examples
    --------
    >>> parameter_table()["omega_n"]["unit"]
    'rad/s'
    """
    return {
        item.name: {"default": item.default, **item.metadata}
        for group in fields(Simulation)
        for item in fields(group.default_factory)
    }
