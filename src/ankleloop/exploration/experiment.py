"""The experiment of the exploration: simulated, identified by two methods, and scored."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ankleloop.assessment.bootstrap import block_bootstrap
from ankleloop.assessment.scores import evaluate
from ankleloop.errors import NUMERICAL_ERRORS
from ankleloop.exploration.controls import usable_options
from ankleloop.joint.dynamics import ReflexDynamics
from ankleloop.joint.estimate import Estimate
from ankleloop.joint.prepared import PreparedTrial, prepare
from ankleloop.methods.registry import identify
from ankleloop.simulation.settings import SimulationSettings
from ankleloop.simulation.simulate import simulate

DURATION = 20.0  # s of a record
REPETITIONS = 40  # of the bootstrap: the fewest that an interval of 95 % takes
BLOCK = 1.5  # s of its blocks
SCORED = {"net": "measured", "intrinsic": "true", "reflex": "true"}  # what each VAF is against


@dataclass(frozen=True)
class Fit:
    """What a method makes of the trial."""

    method: str  # name in the registry
    estimate: Estimate | None = None  # none where the method refuses the trial or its options
    refusal: str = ""  # why it does
    # VAF of each torque [%]: of the net torque against the measured one, of its parts against the true ones; nan for
    # a part that is zero.
    vaf: dict[str, float] = field(default_factory=dict)
    # Poles of the reflex dynamics at the identification rate.
    poles: np.ndarray = field(default_factory=lambda: np.empty(0, complex))
    # 95 % intervals of K, B, I and the parameters of the reflex: the method's own, or those of a bootstrap.
    intervals: dict[str, tuple[float, float]] = field(default_factory=dict)

    @property
    def remark(self) -> str:
        """Why there is no estimate, or the first of its warnings."""
        warnings = [] if self.estimate is None else self.estimate.diagnostics.get("warnings", [])
        return self.refusal or next(iter(warnings), "")


@dataclass(frozen=True)
class Result:
    """An experiment with all that is drawn of it."""

    settings: SimulationSettings | None  # settings; None where they were refused
    trial: PreparedTrial | None  # the trial; None where it cannot be simulated
    refusal: str = ""  # why it cannot
    fits: list[Fit] = field(default_factory=list)  # what both methods make of it
    truth: dict[str, float] = field(default_factory=dict)  # true K, B, I and G
    poles: np.ndarray = field(default_factory=lambda: np.empty(0, complex))  # true poles of the reflex
    seconds: dict[str, float] = field(default_factory=dict)  # processor time of each step


class Experiment:
    """An experiment that is run again with every change.

    Parameters
    ----------
    seed : int
        Seed of perturbation, voluntary torque and noise.
    duration : float
        Length of the record [s].
    """

    def __init__(self, seed: int = 1, duration: float = DURATION) -> None:
        self.seed, self.duration = seed, duration
        self._last: tuple[SimulationSettings, PreparedTrial] | None = None

    def run(
        self, settings: Mapping[str, Any], methods: Sequence[Mapping[str, Any]], *, bootstrap: bool = False
    ) -> Result:
        """Simulate, identify and score; a trial is simulated again only where its settings have changed."""
        seconds = {"simulation": 0.0, "identification": 0.0, "bootstrap": 0.0, "scores": 0.0}
        try:
            with _clock(seconds, "simulation"):
                chosen = SimulationSettings.parse("simulate", duration=self.duration, **settings)
                trial = self._simulate(chosen)
        except NUMERICAL_ERRORS as error:
            return Result(None, None, str(error), seconds=seconds)
        fits = [_fit(trial, entry["method"], entry["options"], bootstrap, seconds) for entry in methods]
        truth = {"K": chosen.stiffness, "B": chosen.viscosity, "I": chosen.inertia, "G": chosen.reflex_gain}
        dynamics = ReflexDynamics(chosen.omega_n, chosen.zeta, chosen.pole)
        rate = next((fit.estimate.torque.attrs["identification_rate"] for fit in fits if fit.estimate), 100.0)
        return Result(chosen, trial, "", fits, truth, _poles_of(dynamics, rate), seconds)

    def _simulate(self, settings: SimulationSettings) -> PreparedTrial:
        if self._last is None or self._last[0] != settings:
            self._last = settings, prepare(simulate(seed=self.seed, **settings.model_dump()))
        return self._last[1]


def _fit(
    trial: PreparedTrial, method: str, options: Mapping[str, Any], bootstrap: bool, seconds: dict[str, float]
) -> Fit:
    usable = usable_options(method, options)
    try:
        with _clock(seconds, "identification"):
            estimate = identify(trial, method, **usable)
    except NUMERICAL_ERRORS as error:
        return Fit(method, refusal=str(error))
    with _clock(seconds, "scores"):
        scores = evaluate(trial, estimate).set_index(["torque", "against"])["vaf"]
        vaf = {torque: float(scores.get((torque, against), np.nan)) for torque, against in SCORED.items()}
    intervals = dict(estimate.intervals)
    if bootstrap and not intervals:
        with _clock(seconds, "bootstrap"):
            intervals = _bootstrap_intervals(trial, method, usable)
    return Fit(method, estimate, "", vaf, _poles(estimate), intervals)


def _bootstrap_intervals(
    trial: PreparedTrial, method: str, options: Mapping[str, Any]
) -> dict[str, tuple[float, float]]:
    """Intervals by the block bootstrap; none where too many of its repetitions fail."""
    try:
        return block_bootstrap(trial, method, repetitions=REPETITIONS, block=BLOCK, **options).intervals()
    except NUMERICAL_ERRORS:
        return {}


@contextmanager
def _clock(seconds: dict[str, float], step: str) -> Iterator[None]:
    """Add the processor time of a step."""
    start = time.process_time()
    try:
        yield
    finally:
        seconds[step] += time.process_time() - start


def _poles(estimate: Estimate) -> np.ndarray:
    """Poles of the reflex dynamics at the identification rate; none where the method has no dynamics."""
    if estimate.matrices is not None:
        return np.linalg.eigvals(estimate.matrices.A)
    if "omega_n" not in estimate.reflex:
        return np.empty(0, complex)
    values = estimate.reflex
    dynamics = ReflexDynamics(values["omega_n"], values["zeta"], values.get("pole"))
    return _poles_of(dynamics, estimate.torque.attrs["identification_rate"])


def _poles_of(dynamics: ReflexDynamics, rate: float) -> np.ndarray:
    return np.linalg.eigvals(dynamics.matrices(rate)[0])


def pole_frequency(poles: np.ndarray, rate: float) -> tuple[np.ndarray, np.ndarray]:
    """Natural frequency and damping ratio of poles in discrete time.

    Shapes: poles (n,); returns frequency, damping (n,).
    """
    poles = np.asarray(poles, dtype=complex)
    continuous = np.log(np.where(poles == 0, np.finfo(float).tiny, poles)) * rate
    size = np.abs(continuous)
    return size / (2 * np.pi), -continuous.real / np.where(size > 0, size, 1.0)
