"""A simulated experiment: parameters and a seed in, a trial with its true torques out."""

from functools import lru_cache
from itertools import islice

import numpy as np

from ankleloop.errors import UnstableLoopError
from ankleloop.records.trial import new_trial
from ankleloop.simulation.excitation import held_noise, prbs, pulses, voluntary_torque
from ankleloop.simulation.filters import antialias
from ankleloop.simulation.loop import build_loop, run_loop
from ankleloop.simulation.settings import Simulation

__all__ = ["simulate", "simulate_trials"]

TOGETHER = 16  # trials of one pass: more of them take memory and no less time


def simulate(
    *,
    seed,
    duration=50.0,
    reflex_gain=13.0,
    load=(1.1, 7.1, 250.0),
    voluntary=0.05,
    snr_db=10.0,
    closed_loop=True,
    recording_rate=1000.0,
    **parameters,
):
    r"""Simulate a trial of the parallel-cascade joint against a compliant load.

    Position = servo(reference) − H_imp(s)·(intrinsic + reflex + voluntary + noise torque), Figure 2 and Section IV of
    Zhao, Ludvig and Kearney (ACC 2008), with

    .. math:: TQ_I = K P + B \dot P + I \ddot P, \qquad
              TQ_R = \frac{G\,\omega_n^2}{s^2 + 2\zeta\omega_n s + \omega_n^2} \max(0, \dot P(t - \tau)).

    The noise level refers to the clean net torque, that of the same seed without noise and voluntary torque.

    Parameters
    ----------
    seed : int or numpy.random.SeedSequence
        The same seed gives the same bits; perturbation, voluntary torque and noise have streams of their own, so
        a change of one parameter leaves the other signals as they were.
    duration : float
        Length of the record [s].
    reflex_gain : float
        Reflex gain G [N·m·s/rad].
    load : tuple of float
        Inertia [kg·m²], viscosity [N·m·s/rad] and stiffness [N·m/rad] of the load.
    voluntary : float
        Standard deviation of the voluntary torque, as a fraction of that of the clean net torque.
    snr_db : float or None
        Signal-to-noise ratio of the recorded torque [dB]; None for no noise.
    closed_loop : bool
        False for a stiff servo: the torque does not move the joint.
    recording_rate : float
        Sampling rate of the record [Hz].
    **parameters
        Any other name of `ankleloop.simulation.parameter_table`.

    Returns
    -------
    xarray.Dataset
        A trial with `position`, `torque`, `reference` and the truths `torque_intrinsic`, `torque_reflex`,
        `torque_voluntary`, `torque_noise`, all behind the same anti-aliasing filter. The parameters are attributes.

    Raises
    ------
    UnstableLoopError
        If the loop diverges.
    TypeError, ValueError
        For an unknown parameter or a value outside its bounds.

    Examples
    --------
    >>> trial = simulate(seed=1, duration=10.0)
    >>> trial.sizes["time"]
    10000
    """
    names = {"duration": duration, "reflex_gain": reflex_gain, "load": load, "voluntary": voluntary, "snr_db": snr_db}
    names |= {"closed_loop": closed_loop, "recording_rate": recording_rate}
    return next(simulate_trials([seed], **names, **parameters))


def simulate_trials(seeds, *, load=(1.1, 7.1, 250.0), **parameters):
    """Simulate trials that differ in their seeds alone, several in one pass.

    Parameters
    ----------
    seeds : iterable of int or numpy.random.SeedSequence
        Seed of each trial; it gives the same bits as `simulate` does.
    load, **parameters
        As `simulate` takes them.

    Yields
    ------
    xarray.Dataset
        A trial.

    Raises
    ------
    UnstableLoopError
        If the loop diverges.
    TypeError, ValueError
        For an unknown parameter or a value outside its bounds.

    Examples
    --------
    >>> [trial.attrs["seed"] for trial in simulate_trials([3, 4], duration=2.0)]
    [3, 4]
    """
    if np.shape(load) != (3,):
        raise ValueError(f"load must be three numbers (inertia, viscosity, stiffness), got {load!r}.")
    names = dict(zip(("load_inertia", "load_viscosity", "load_stiffness"), load, strict=True))
    simulation = Simulation.from_flat(**{**names, **parameters})
    loop, waiting = build_loop(simulation), iter(seeds)
    while block := list(islice(waiting, TOGETHER)):
        yield from _simulated(simulation, loop, block)


def _simulated(simulation, loop, seeds):
    """One pass over all signals of a block of trials."""
    rate = simulation.recorder.recording_rate
    dropped = round(simulation.run.settling * rate)
    samples = dropped + round(simulation.run.duration * rate)
    streams = [_streams(seed) for seed in seeds]
    command = np.stack([_command(of[0], samples, simulation.perturbation, rate) for of in streams])
    nothing = np.zeros(command.shape)
    recorded = _recorded(loop, simulation, command, nothing, nothing)
    clean = np.std((recorded[1] + recorded[2])[:, dropped:], axis=1)[:, None]
    disturbances, noise, spontaneous = simulation.disturbances, nothing, nothing
    if disturbances.voluntary > 0:
        unit = [voluntary_torque(of[1], samples, rate, disturbances.voluntary_cutoff) for of in streams]
        spontaneous = disturbances.voluntary * clean * np.stack(unit)
    if disturbances.snr_db is not None:
        hold = round(rate / disturbances.noise_rate)
        level = clean * 10 ** (-disturbances.snr_db / 20) / _recorded_deviation(simulation, hold)
        noise = level * np.stack([held_noise(of[2], samples, hold) for of in streams])
    if noise is not nothing or spontaneous is not nothing:
        recorded = _recorded(loop, simulation, command, noise, spontaneous)
    external = [antialias(command, simulation, "zoh"), *_filtered_torques(simulation, noise, spontaneous, nothing)]
    described = {name: value for name, value in simulation.flat().items() if value is not None}
    described = {name: int(value) if isinstance(value, bool) else value for name, value in described.items()}
    for k, seed in enumerate(seeds):
        position, intrinsic, reflex = recorded[:, k, dropped:]
        reference, heard, own = (signal[k, dropped:] for signal in external)
        yield new_trial(
            position,
            intrinsic + reflex + own + heard,
            rate,
            reference,
            torque_intrinsic=intrinsic,
            torque_reflex=reflex,
            torque_voluntary=own,
            torque_noise=heard,
            # Any entropy, also what is too long for an integer of a file.
            seed=seed if isinstance(seed, int) and abs(seed) < 2**63 else str(_sequence(seed)),
            **described,
        )


def _filtered_torques(simulation, noise, spontaneous, nothing):
    """Noise and voluntary torque as they are recorded; what is nothing needs no filter."""
    pairs = ((noise, "zoh"), (spontaneous, "foh"))
    return [signal if signal is nothing else antialias(signal, simulation, hold) for signal, hold in pairs]


def _sequence(seed):
    if seed is None:
        raise ValueError("seed must be a number or a SeedSequence: a trial has to be reproducible.")
    return seed if isinstance(seed, np.random.SeedSequence) else np.random.SeedSequence(seed)


def _streams(seed):
    """Generators of perturbation, voluntary torque and noise.

    Children are keyed by hand, not spawned: spawning counts, and the same seed would give other bits next time.
    """
    root = _sequence(seed)
    keys = [(*root.spawn_key, k) for k in range(3)]
    return [np.random.default_rng(np.random.SeedSequence(root.entropy, spawn_key=key)) for key in keys]


def _command(rng, samples, perturbation, rate):
    interval = round(perturbation.switching_interval * rate)
    if perturbation.perturbation == "prbs":
        return prbs(rng, samples, interval, perturbation.amplitude)
    return pulses(rng, samples, interval, round(perturbation.pulse_length * rate), perturbation.amplitude)


@lru_cache
def _recorded_deviation(simulation, hold):
    """Standard deviation that the recorder leaves of unit white noise, each value of which is held."""
    one_value = np.zeros(100 * hold)
    one_value[:hold] = 1.0
    return float(np.sqrt(np.sum(antialias(one_value, simulation, "zoh") ** 2) / hold))


def _recorded(loop, simulation, command, noise, voluntary):
    recorded, diverged = run_loop(loop, simulation, command, noise, voluntary)
    if diverged >= 0:
        s = simulation
        at = diverged / s.recorder.recording_rate
        raise UnstableLoopError(
            f"the closed loop is unstable: the position passes ±{s.run.position_limit:g} rad after {at:.3g} s. "
            f"Parameters: load_inertia={s.load.load_inertia:g} kg·m², load_viscosity={s.load.load_viscosity:g} "
            f"N·m·s/rad, load_stiffness={s.load.load_stiffness:g} N·m/rad, reflex_gain={s.reflex.reflex_gain:g} "
            f"N·m·s/rad, delay={s.reflex.delay:g} s, stiffness={s.intrinsic.stiffness:g} N·m/rad, "
            f"viscosity={s.intrinsic.viscosity:g} N·m·s/rad. "
            "Take a heavier or more damped load, or a lower reflex gain."
        )
    return recorded
