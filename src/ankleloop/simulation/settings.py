"""Settings of the simulated experiment, each with its unit, default and bounds.

Defaults are those of Zhao, Ludvig and Kearney (ACC 2008) where the paper gives them. The others (load, actuator,
recorder, level of voluntary torque, reflex gain of its Table 1) are assumptions, marked as such.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal, Self

from pydantic import ValidationInfo, field_validator, model_validator

from ankleloop.options import Options, option, show_value

# Integration steps over a recorded sample: the loop has a matrix of as many rows.
MOST_INTEGRATION_STEPS = 1000
LOAD = "load"  # the three of them together
LOAD_SETTINGS = ("load_inertia", "load_viscosity", "load_stiffness")
# Dwell times of the perturbation "dwells" [s].
DWELL_TIMES = (0.02, 0.03, 0.04, 0.06, 0.08, 0.1, 0.15, 0.2, 0.3, 0.4, 0.6)
DWELL_TEXT = ", ".join(f"{1000 * dwell:g}" for dwell in DWELL_TIMES)

Table = tuple[float, ...] | str  # numbers, or a text that holds them


def expand_load(values: Mapping[str, Any]) -> dict[str, Any]:
    """Settings with the three parameters of the load in the place of `load`; a single one that is given counts more.

    Raises
    ------
    ValueError
        If the load is not three values.
    """
    settings = dict(values)
    load = settings.pop(LOAD, None)
    if load is None:
        return settings
    try:
        parameters = dict(zip(LOAD_SETTINGS, load, strict=True))
    except (TypeError, ValueError):
        raise ValueError(
            f"load must be three numbers (inertia, viscosity, stiffness), got {load!r}."
        ) from None
    return {**parameters, **settings}


def _variation_option(symbol: str) -> Any:
    """Declare by how much a parameter of the joint varies."""
    return option(
        0.0,
        f"{symbol} goes from (1 - this) to (1 + this) times its mean, where `variation` is set",
        ge=0,
        le=1,
    )


def _peak_option(symbol: str) -> Any:
    """Declare where a parameter of the joint is largest."""
    return option(
        0.5, f"place within 0 … 1 of what it varies with at which {symbol} is largest", ge=0, le=1
    )


def _table_option(symbol: str, unit: str) -> Any:
    """Declare the values of a parameter of the joint."""
    return option(
        None,
        f"values of {symbol} at equal distances from 0 to 1 of what it varies with, in the place of mean, variation "
        "and peak, joined by straight lines; over a cycle the first value follows the last one, else the last is at 1; "
        "a list, or numbers with commas between them, as points of a study have them",
        unit=unit,
    )


class SimulationSettings(Options):
    """Settings of a simulated experiment.

    They come in groups: the joint with its intrinsic stiffness (Eq. 16) and its reflex (Eq. 2, 17), how K, B and G vary
    within the record, the load H_imp(s) = 1 / (I_L s² + B_L s + K_L), the actuator that turns the command into a
    position, the perturbation, the disturbances, the recorder and the run.
    """

    # Intrinsic stiffness: TQ_I = K·P + B·Ṗ + I·P̈.
    stiffness: float = option(150.0, "intrinsic elastic stiffness K", unit="N·m/rad", ge=0, le=1e6)
    viscosity: float = option(0.8, "intrinsic viscosity B", unit="N·m·s/rad", ge=0, le=1e5)
    inertia: float = option(0.015, "intrinsic inertia I", unit="kg·m²", ge=0, le=1e4)

    # Reflex stiffness: delayed velocity, half-wave rectified, through a low-pass of order 2 or 3.
    reflex_gain: float = option(
        13.0, "reflex gain G; assumed, Eq. 17 prints 2", unit="N·m·s/rad", ge=0, le=1e5
    )
    reflex_threshold: float = option(
        0.0, "velocity at which the rectifier begins", unit="rad/s", ge=0, le=1000
    )
    omega_n: float = option(
        40.0, "natural frequency of the reflex low-pass", unit="rad/s", ge=0.01, le=1e5
    )
    zeta: float = option(1.0, "damping ratio of the reflex low-pass", ge=0.001, le=1000)
    delay: float = option(0.040, "reflex delay; at least one recorded sample", unit="s", gt=0, le=1)
    pole: float | None = option(
        None, "extra real pole p (Eq. 2); null: none", unit="rad/s", ge=0.01, le=1e5
    )

    # Variation of K, B and G within the record; `stiffness`, `viscosity` and `reflex_gain` are the means.
    variation: Literal["cycle", "time", "schedule"] | None = option(
        None,
        "what K, B and G vary with: the phase of a cycle, the time over the record, or the scheduling variable of the "
        "trial; null: they are constant",
    )
    variation_shape: Literal["smooth", "square"] = option(
        "smooth", "how they vary: as one period of a cosine, or of a square wave"
    )
    stiffness_variation: float = _variation_option("K")
    viscosity_variation: float = _variation_option("B")
    gain_variation: float = _variation_option("G")
    stiffness_peak: float = _peak_option("K")
    viscosity_peak: float = _peak_option("B")
    gain_peak: float = _peak_option("G")
    stiffness_table: Table | None = _table_option("K", "N·m/rad")
    viscosity_table: Table | None = _table_option("B", "N·m·s/rad")
    gain_table: Table | None = _table_option("G", "N·m·s/rad")
    cycle_duration: float = option(1.4, "mean duration of a cycle", unit="s", gt=0, le=1e5)
    cycle_jitter: float = option(
        0.0, "durations of cycles lie evenly within ± this share of their mean", ge=0, le=0.5
    )
    schedule_period: float = option(
        10.0,
        "period of one sinusoid of the scheduling variable; 0.618 of it of the other",
        unit="s",
        gt=0,
        le=1e5,
    )
    movement: float = option(
        0.0,
        "peak-to-peak amplitude of a slow command: a sinusoid over each cycle, or the scheduling variable",
        unit="rad",
        ge=0,
        le=1000,
    )
    locked_torque: float = option(
        0.0,
        "deviation of a voluntary torque that repeats with the cycle, over that of the clean torque",
        ge=0,
        le=1e6,
    )

    # Impedance-controlled load.
    load_inertia: float = option(
        1.1, "inertia I_L of the simulated load; assumed", unit="kg·m²", ge=1e-6, le=1e6
    )
    load_viscosity: float = option(
        7.1, "viscosity B_L of the simulated load; assumed", unit="N·m·s/rad", ge=0, le=1e7
    )
    load_stiffness: float = option(
        250.0, "stiffness K_L of the simulated load; assumed", unit="N·m/rad", ge=0, le=1e12
    )

    # Position servo of second order between the command and the joint.
    actuator_frequency: float = option(
        20.0, "natural frequency of the servo; assumed", unit="Hz", ge=0.01, le=1e4
    )
    actuator_damping: float = option(0.8, "damping ratio of the servo; assumed", ge=0.001, le=1000)

    # Position command, the reference. Pulses well below the delay decorrelate the two paths.
    perturbation: Literal["prbs", "pulses", "dwells"] = option(
        "prbs",
        "kind of the position command: pseudorandom binary sequence, short pulses, or steps after random times",
    )
    dwell_weights: Table | None = option(
        None,
        f"weights of the dwell times {DWELL_TEXT} ms; null for equal ones",
    )
    amplitude: float = option(
        0.04, "peak-to-peak amplitude of the position command", unit="rad", ge=1e-9, le=1000
    )
    perturbation_locked: bool = option(
        False, "true: the same in every cycle, from which no method can tell it"
    )
    switching_interval: float = option(
        0.1, "interval at which the PRBS may switch, or a pulse begin", unit="s", gt=0, le=1000
    )
    pulse_length: float = option(
        0.02, "length of the pulses, well below the delay", unit="s", gt=0, le=1000
    )

    # Disturbances, both of which are fed back through the load. The clean net torque is that of the perturbation alone.
    torque_level: float | None = option(
        None,
        "torque that stands for the deviation of the clean net torque; null for that",
        unit="N·m",
        gt=0,
        le=1e6,
    )
    voluntary: float = option(
        0.05,
        "standard deviation of the voluntary torque over that of the clean net torque; assumed",
        ge=0,
        le=1e6,
    )
    voluntary_cutoff: float = option(
        2.0, "-3 dB frequency of its Bessel low-pass", unit="Hz", ge=0.01, le=1e5
    )
    snr_db: float | None = option(
        10.0, "clean net torque over noise, as recorded; null: no noise", unit="dB", ge=-100, le=300
    )
    noise_rate: float = option(
        100.0, "rate at which white noise is drawn and held", unit="Hz", ge=0.1, le=1e5
    )

    # Anti-aliasing filter and sampler of every channel.
    recording_rate: float = option(1000.0, "sampling rate of the record", unit="Hz", ge=1, le=1e5)
    antialias_cutoff: float | None = option(
        200.0,
        "-3 dB frequency of the fourth-order Bessel filter; assumed; null: no filter",
        unit="Hz",
        ge=0.01,
        le=1e5,
    )

    # Run.
    duration: float = option(50.0, "length of the record", unit="s", gt=0, le=1e6)
    settling: float = option(
        5.0, "time simulated ahead of the record, and dropped", unit="s", ge=0, le=1e5
    )
    integration_rate: float = option(
        10000.0, "rate of the exact discretisation of the loop", unit="Hz", ge=1, le=1e7
    )
    closed_loop: bool = option(True, "false: stiff servo, torque does not move the joint")
    position_limit: float = option(
        1.0, "a loop that leaves ± this is declared unstable", unit="rad", ge=1e-9, le=1e6
    )

    @property
    def disturbed(self) -> bool:
        """Whether there is noise or voluntary torque at random."""
        return self.snr_db is not None or self.voluntary > 0

    @classmethod
    def parse(cls, owner: str, /, **values: Any) -> Self:
        """Check settings and fill in the defaults; the three parameters of the load may come together."""
        return super().parse(owner, **expand_load(values))

    @field_validator(
        "stiffness_table", "viscosity_table", "gain_table", "dwell_weights", mode="before"
    )
    @classmethod
    def _as_table(cls, values: Any, info: ValidationInfo) -> Any:
        """Tables come as lists from YAML, as arrays from NumPy, and as text from points of a study."""
        if values is None:
            return None
        numbers = values.split(",") if isinstance(values, str) else values
        try:
            table = tuple(map(float, numbers))
        except (TypeError, ValueError):
            table = ()
        if len(table) < 2:
            name = str(info.field_name)
            form = f"2 numbers [{cls.unit(name)}] or more, in a list or a text with commas"
            raise ValueError(f"{name} must be {form}, got {show_value(values)}.")
        return table

    @model_validator(mode="after")
    def _check_tables(self) -> Self:
        """Tables hold no negative values, and nothing varies where `variation` says that nothing does."""
        weights = self.dwell_weights
        if isinstance(weights, tuple) and (
            len(weights) != len(DWELL_TIMES) or min(weights) < 0 or max(weights) == 0
        ):
            raise ValueError(
                f"dwell_weights must be {len(DWELL_TIMES)} numbers of at least 0, not all 0, got {weights}."
            )
        for name in ("stiffness", "viscosity", "gain"):
            table = getattr(self, f"{name}_table")
            share = getattr(self, f"{name}_variation")
            if table is not None and min(table) < 0:
                raise ValueError(
                    f"{name}_table must hold values of at least 0, got {min(table):g}."
                )
            if self.variation is None and (table is not None or share > 0):
                raise ValueError(
                    f"{name}_table and {name}_variation need `variation`: cycle, time or schedule."
                )
        return self

    @model_validator(mode="after")
    def _check_times(self) -> Self:
        """What is held or switched has to fall on recorded samples, and the reflex needs a recorded past."""
        rate = self.recording_rate
        interval = self.switching_interval
        steps = self.integration_rate / rate
        counts = {
            "duration × recording_rate": self.duration * rate,
            "settling × recording_rate": self.settling * rate,
            "switching_interval × recording_rate": interval * rate,
            "pulse_length × recording_rate": self.pulse_length * rate,
            "recording_rate / noise_rate": rate / self.noise_rate,
            "integration_rate / recording_rate": steps,
        }
        for name, count in counts.items():
            whole = round(count)
            fewest = 0 if name.startswith("settling") else 1
            if abs(count - whole) > 1e-6 or whole < fewest:
                raise ValueError(f"{name} must be a whole number, got {count:g}.")
        if steps > MOST_INTEGRATION_STEPS + 0.5:
            raise ValueError(
                f"integration_rate / recording_rate must be at most {MOST_INTEGRATION_STEPS}, got {steps:g}."
            )
        if self.perturbation == "pulses" and self.pulse_length > interval * (1 + 1e-9):
            raise ValueError(
                f"pulse_length must be at most the switching_interval, {interval:g} s."
            )
        if self.voluntary_cutoff >= rate / 2:
            raise ValueError(
                f"voluntary_cutoff must be below half of the recording_rate, {rate / 2:g} Hz."
            )
        if self.delay * rate < 1 - 1e-9:
            raise ValueError(f"delay must be at least one recorded sample, {1 / rate:g} s.")
        return self
