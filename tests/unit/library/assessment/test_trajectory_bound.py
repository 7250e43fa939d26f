"""The bound of trajectories against differences of simulated records, and against that of constant joints."""

import numpy as np
import pytest

from ankleloop import DataError, simulate
from ankleloop.assessment.cramer_rao import (
    disturbance_spectrum,
    fisher_information,
    trajectory_bound,
    trajectory_information,
)
from ankleloop.joint.prepared import prepare
from ankleloop.simulation.settings import SimulationSettings

LIGHT = (0.1, 10.0, 100.0)
OPEN = {
    "closed_loop": False,
    "variation": "cycle",
    "cycle_duration": 1.4,
    "duration": 42.0,
    "stiffness_variation": 0.4,
    "viscosity_variation": 0.3,
    "viscosity_peak": 0.4,
    "gain_variation": 0.6,
    "gain_peak": 0.7,
}
CHANGES = {  # of a setting, and what it changes: mean and place of the largest value
    "stiffness_variation": ("K", 150.0, 0.5),
    "gain_variation": ("G", 13.0, 0.7),
    "zeta": ("zeta", 0.0, 0.0),
    "delay": ("delay", 0.0, 0.0),
}


def information_of(seed, knots, *, known_delay=True, **settings):
    settings = SimulationSettings.parse("test", **settings)
    equations, _, information = trajectory_information(
        seed, settings, knots, known_delay=known_delay
    )
    return information, equations.bases


def torque_of_cycles(**settings):
    """Torque less what repeats, at 100 Hz, in whole cycles that begin at the second."""
    trial = prepare(simulate(seed=4, snr_db=None, voluntary=0.0, **{**OPEN, **settings}))
    torque = trial.channel_at("torque", 1.4 + 0.01 * np.arange(28 * 140), 100.0)
    cycles = torque.reshape(28, 140)
    return (cycles - cycles.mean(axis=0)).ravel()


@pytest.mark.parametrize("name", list(CHANGES))
def test_information_against_differences_of_records(name):
    """A change of a setting changes the torque; its power over the density of the noise is the information."""
    parameter, mean, peak = CHANGES[name]
    truth = OPEN.get(name, getattr(SimulationSettings(), name))
    # A delay is a whole number of steps of the simulation.
    step = 0.001 if name == "delay" else 0.002 * truth
    slope = (
        torque_of_cycles(**{name: truth + step}) - torque_of_cycles(**{name: truth - step})
    ) / (2 * step)
    frequency = np.fft.rfftfreq(slope.size, 0.01)
    inside = (frequency >= 0.05) & (frequency <= 38.0)
    clean = simulate(seed=4, snr_db=None, voluntary=0.0, **OPEN)["torque"].values
    noise = disturbance_spectrum(
        frequency[inside], float(np.std(clean)), SimulationSettings.parse("test", **OPEN)
    )
    energy = np.abs(np.fft.rfft(slope)[inside]) ** 2 / slope.size
    expected = 2.0 * np.sum(energy / (50.0 * noise))
    information, bases = information_of(4, (16, 16, 16), known_delay=False, **OPEN)
    direction = np.zeros(len(information))
    if parameter in bases.blocks:
        places = np.linspace(0.0, 1.0, 400, endpoint=False)
        splines, block = bases.splines[parameter], bases.blocks[parameter]
        change = mean * np.cos(2 * np.pi * (places - peak))
        direction[block] = np.linalg.lstsq(splines(places), change, rcond=None)[0]
    else:
        place = bases.size + ("omega_n", "zeta", "delay").index(parameter)
        direction[place] = 1.0 if name == "delay" else 1.0 / truth
    assert direction @ information @ direction == pytest.approx(expected, rel=0.03)


@pytest.mark.parametrize(("variation", "shares"), [("time", (0.99, 0.99)), ("cycle", (0.98, 0.93))])
def test_means_have_the_information_of_a_constant_joint(variation, shares):
    """But for what repeats: with switches 200 ms apart the reflex acts at the same phases of all cycles of 1.4 s."""
    settings = {"load": LIGHT, "voluntary": 0.3, "duration": 210.0}
    clean = prepare(simulate(seed=3, snr_db=None, **settings | {"voluntary": 0.0}))
    names, constant = fisher_information(
        clean, SimulationSettings.parse("test", **settings), fed_back=False
    )
    information, bases = information_of(3, (12, 8, 12), variation=variation, **settings)
    sums = np.zeros((len(information), len(names)))
    for column, name in enumerate(names[:4]):
        sums[bases.blocks[name], column] = 1.0
    sums[bases.size, 4], sums[bases.size + 1, 5] = 1.0 / 40.0, 1.0
    assert names == ["K", "B", "I", "G", "omega_n", "zeta"]
    share = np.diag(sums.T @ information @ sums) / np.diag(constant)
    np.testing.assert_allclose(share[:3], shares[0], atol=0.015)
    np.testing.assert_allclose(share[3:], shares[1], atol=0.03)


@pytest.mark.parametrize("variation", ["cycle", "time", "schedule"])
def test_bounds_shrink_with_the_noise_and_grow_with_the_knots(variation):
    settings = {
        "seed": 1,
        "variation": variation,
        "duration": 30.0,
        "stiffness_variation": 0.3,
        "pole": 60.0,
    }
    loud = trajectory_bound(snr_db=10.0, voluntary=0.05, known_delay=False, **settings)
    quiet = trajectory_bound(snr_db=30.0, voluntary=0.005, known_delay=False, **settings)
    few = trajectory_bound(
        snr_db=10.0, voluntary=0.05, known_delay=False, knots=(6, 4, 6), **settings
    )
    for name in ("K", "B", "G", "I", "omega_n", "zeta", "pole", "delay"):
        np.testing.assert_allclose(loud[name] / quiet[name], 10.0, rtol=1e-6)
    for name in "KBG":
        assert float(few[name].mean()) < float(loud[name].mean())
        assert float(loud[f"{name}_mean"]) < float(loud[name].mean())


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({}, "derived for a joint that varies"),
        ({"variation": "cycle", "reflex_threshold": 0.1}, "set .* reflex_threshold=0"),
        ({"variation": "cycle", "snr_db": None, "voluntary": 0.0}, "and snr_db or voluntary"),
    ],
)
def test_settings_without_a_bound(settings, message):
    with pytest.raises(ValueError, match=message):
        trajectory_bound(seed=1, **settings)


def test_too_many_knots_are_refused():
    with pytest.raises(DataError, match="does not tell the splines apart"):
        trajectory_bound(seed=1, variation="cycle", duration=16.0, knots=(200, 200, 200))
