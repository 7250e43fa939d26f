"""The Cramér-Rao bound against differences of simulated records, and against the errors of an efficient method."""

import numpy as np
import pytest

from ankleloop import DataError, cramer_rao, identify, simulate
from ankleloop.assessment.cramer_rao import (
    disturbance_spectrum,
    fisher_information,
    invert_information,
)
from ankleloop.joint.prepared import prepare
from ankleloop.signals.spectra import Band
from ankleloop.simulation.settings import SimulationSettings

LINEAR = {"reflex_gain": 1e-6, "duration": 30.0, "seed": 4}
TRUTH = {"stiffness": 150.0, "viscosity": 0.8, "inertia": 0.015}


def information_of(seed, *, fed_back=True, **settings):
    clean = prepare(simulate(seed=seed, snr_db=None, **settings | {"voluntary": 0.0}))
    return fisher_information(clean, SimulationSettings(**settings), fed_back=fed_back)


def torque_spectrum(**parameters):
    trial = simulate(**LINEAR, snr_db=None, voluntary=0.0, **parameters)
    time = np.arange(1.0, 29.0, 0.01)
    band = Band(time.size, 100.0, 0.05, 38.0)
    return band, band.transform(prepare(trial).channel_at("torque", time, 100.0))


@pytest.mark.parametrize("number", range(3))
def test_information_against_differences_of_records(number):
    """A changed parameter changes the torque by S ψ δθ, and S acts on the noise alike."""
    name, truth = list(TRUTH.items())[number]
    band, below = torque_spectrum(**{name: 0.999 * truth})
    _, above = torque_spectrum(**{name: 1.001 * truth})
    slope = (above - below) / (0.002 * truth)
    s = band.s
    passive = 0.015 * s**2 + 0.8 * s + 150.0
    sensitivity = 1.0 / (1.0 + passive / (1.1 * s**2 + 7.1 * s + 250.0))
    settings = SimulationSettings(reflex_gain=1e-6, duration=30.0)
    level = np.std(simulate(**LINEAR, snr_db=None, voluntary=0.0)["torque"].values)
    noise = (
        disturbance_spectrum(band.frequency, level, settings)
        * band.density
        * np.abs(sensitivity) ** 2
    )
    expected = 2.0 * np.sum(np.abs(slope) ** 2 / noise)
    _, information = information_of(**LINEAR, fed_back=False)
    # The differences see 28 of the 30 seconds.
    assert information[number, number] == pytest.approx(expected * 29.6 / 28.0, rel=0.04)


def test_information_of_a_known_spectrum():
    """Against differences of the logarithm of a spectrum, computed from the transfer functions."""
    names, known = information_of(**LINEAR)
    _, unknown = information_of(**LINEAR, fed_back=False)
    frequency = np.arange(0.05, 38.0, 0.01)
    s = 2j * np.pi * frequency
    load = 1.1 * s**2 + 7.1 * s + 250.0

    def spectrum(K, B, I):  # noqa: E741 - the field's name
        return -2 * np.log(np.abs(1 + (K + B * s + I * s**2) / load))

    slope = (spectrum(150.01, 0.8, 0.015) - spectrum(149.99, 0.8, 0.015)) / 0.02
    # One number for each independent frequency, 1 / T apart.
    expected = 29.6 * np.trapezoid(slope**2, frequency)
    assert names[:3] == ["K", "B", "I"]
    assert (known - unknown)[0, 0] == pytest.approx(expected, rel=0.03)
    assert np.all(np.linalg.eigvalsh(known - unknown) > -1e-9 * np.max(known))


def test_spectra_of_simulated_disturbances():
    ratios, settings = [], SimulationSettings(voluntary=0.3)
    for seed in range(8):
        trial = simulate(seed=seed, voluntary=0.3)
        clean = simulate(seed=seed, voluntary=0.0, snr_db=None)
        disturbance = (trial["torque_voluntary"] + trial["torque_noise"]).values
        band = Band(disturbance.size, 1000.0, 0.05, 38.0)
        density = np.abs(band.transform(disturbance)) ** 2 / band.density
        ratios.append(
            density / disturbance_spectrum(band.frequency, np.std(clean["torque"].values), settings)
        )
    mean = np.mean(ratios, axis=0)
    for low, high in ((0.05, 3.0), (3.0, 10.0), (10.0, 38.0)):
        selection = (band.frequency >= low) & (band.frequency < high)
        margin = 5.0 * np.sqrt(band.correlation / (8 * selection.sum()))
        assert mean[selection].mean() == pytest.approx(1.0, abs=margin)


def test_an_efficient_method_reaches_the_bound():
    bound = np.mean([cramer_rao(seed=seed)["K"] for seed in range(4)])
    estimates = [identify(simulate(seed=seed), "riv").stiffness["K"] for seed in range(25)]
    rmse = np.sqrt(np.mean((np.array(estimates) - 150.0) ** 2))
    assert 0.65 * bound < rmse < 1.5 * bound


# --- degenerate settings


def test_the_bound_of_a_record_without_disturbance_is_zero():
    exact = cramer_rao(seed=1, duration=20.0, snr_db=None, voluntary=0.0)
    assert set(exact.values()) == {0.0}
    bound = cramer_rao(seed=1, duration=20.0, snr_db=None, voluntary=0.0, reflex_gain=0.0)
    assert bound == {"K": 0.0, "B": 0.0, "I": 0.0, "G": 0.0, "omega_n": np.inf, "zeta": np.inf}


def test_settings_without_a_bound_are_refused():
    with pytest.raises(ValueError, match=r"reflex_threshold must be 0, got 0\.1"):
        cramer_rao(seed=1, duration=20.0, reflex_threshold=0.1)


def test_parameters_that_the_record_does_not_tell_apart_are_named():
    information = np.array([[1.0, 0.0, 2.0], [0.0, 3.0, 0.0], [2.0, 0.0, 4.0]])
    with pytest.raises(DataError, match="does not tell K, I apart: their information is singular"):
        invert_information(information, ["K", "B", "I"])


def test_the_noise_of_a_recorder_without_a_filter_is_held_white_noise():
    """Its power is that of all frequencies, half of the rate of its draws times its density at zero."""
    settings = SimulationSettings(antialias_cutoff=None, voluntary=0.0)
    density = disturbance_spectrum(np.array([0.0, 20.0, 100.0]), 3.0, settings)
    expected = (
        0.1 * 3.0**2 / 50.0 * np.array([1.0, (np.sin(0.2 * np.pi) / (0.2 * np.pi)) ** 2, 0.0])
    )
    np.testing.assert_allclose(density, expected, rtol=1e-12, atol=1e-15)
    filtered = disturbance_spectrum(np.array([0.0, 20.0]), 3.0, SimulationSettings(voluntary=0.0))
    # Behind a filter the same ratio takes more noise, of which less is in the band.
    assert np.all(filtered > density[:2])
