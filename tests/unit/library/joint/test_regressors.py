"""Inputs of an identification against the truth of the simulation, and on one grid of samples."""

import numpy as np
import pytest

from ankleloop import DataError, new_trial, simulate
from ankleloop.joint.prepared import prepare

OPTIONS = {"delay": 0.04, "basis": "rectifier", "degree": 1, "identification_rate": 100.0}


@pytest.fixture(scope="module")
def clean():
    return simulate(seed=1, duration=30.0, snr_db=None, voluntary=0.0)


def test_intrinsic_regressors_give_the_intrinsic_torque(clean):
    """Equation 3 with the parameters of the simulation: the channels and the torque went through the same filters."""
    trial = prepare(clean)
    regressors = trial.regressors(**OPTIONS)
    truth = trial.channel_at("torque_intrinsic", regressors.time, 100.0)
    torque = regressors.inputs[:, :3] @ [150.0, 0.8, 0.015]
    assert np.std(torque - truth) < 1e-3 * np.std(truth)
    assert regressors.fit_stiffness(truth) == pytest.approx(
        {"K": 150.0, "B": 0.8, "I": 0.015}, rel=2e-3
    )
    rows = np.arange(100, 2000)
    assert regressors.fit_stiffness(truth[rows], rows) == pytest.approx(
        {"K": 150.0, "B": 0.8, "I": 0.015}, rel=2e-3
    )


@pytest.mark.parametrize("delay", [0.0, 0.04, 0.0403])
def test_a_rectified_sinusoid_is_its_fourier_series(delay):
    """The nonlinearity comes first, the low-pass after it: harmonics below 38 Hz stay, those above 50 Hz go."""
    frequency, rate = 9.0, 5000.0
    time = np.arange(int(8 * rate)) / rate
    w = 2 * np.pi * frequency
    regressors = prepare(new_trial(0.02 * np.sin(w * time), np.sin(w * time), rate)).regressors(
        **OPTIONS | {"delay": delay}
    )
    phase = w * (regressors.time - delay)
    even = sum(
        np.cos(2 * k * phase) * (-1) ** k / (4 * k**2 - 1) for k in (1, 2)
    )  # 18 and 36 Hz, not 54 Hz
    expected = 0.02 * w * (1 / np.pi + np.cos(phase) / 2 - 2 / np.pi * even)
    np.testing.assert_allclose(regressors.inputs[:, 3], expected, rtol=0, atol=1e-4 * 0.02 * w)


def test_the_reflex_regressor_drives_the_reflex_torque(clean):
    """The continuous low-pass of Eq. 2, applied in the frequency domain, makes the torque of the rectified velocity."""
    trial = prepare(clean)
    regressors = trial.regressors(**OPTIONS)
    truth = trial.channel_at("torque_reflex", regressors.time, 100.0)
    drive = regressors.inputs[:, 3]
    size = 8 * drive.size
    s = 2j * np.pi * np.fft.rfftfreq(size, 0.01)
    torque = np.fft.irfft(
        np.fft.rfft(drive, size) * 13.0 * 1600.0 / (s**2 + 80.0 * s + 1600.0), size
    )
    inside = slice(100, drive.size - 100)  # beyond the effect of the periodic convolution
    error = torque[: drive.size] - truth
    assert np.std(error[inside]) < 2e-3 * np.std(truth[inside])


def test_times_are_those_of_the_record(clean):
    whole = prepare(clean).regressors(**OPTIONS)
    part = prepare(clean.isel(time=slice(5000, None)))
    later = part.regressors(**OPTIONS)
    assert np.allclose(np.diff(whole.time), 0.01)
    shared = np.isin(np.round(whole.time, 6), np.round(later.time, 6))
    np.testing.assert_allclose(whole.time[shared], later.time, atol=1e-9)
    # The means that differentiation subtracts differ, and so does the rounding.
    np.testing.assert_allclose(whole.inputs[shared], later.inputs, atol=1e-6)
    np.testing.assert_allclose(
        part.channel_at("torque", later.time, 100.0), later.torque, atol=1e-12
    )


def test_predicted_inputs_are_free_of_fed_back_noise():
    """They follow the reference, so they are nearly the same whatever the noise; the measured ones are not."""
    positions = []
    for db in (None, 0.0):
        trial = prepare(
            simulate(
                seed=2,
                duration=50.0,
                reflex_gain=2.0,
                voluntary=0.0,
                snr_db=db,
                load=(0.3, 10.0, 100.0),
            )
        )
        regressors = trial.regressors(reference="reference", **OPTIONS)
        positions.append((regressors.inputs[:, 0], trial.predict_inputs(regressors)[:, 0]))
    (clean, from_clean), (noisy, from_noisy) = positions
    assert np.std(from_clean - clean) < 0.1 * np.std(clean)
    assert np.std(from_noisy - clean) < 0.5 * np.std(noisy - clean)


def test_predicted_inputs_in_open_loop_are_the_inputs(clean):
    trial = prepare(clean)
    regressors = trial.regressors(reference="position", **OPTIONS)
    assert trial.predict_inputs(regressors) is regressors.inputs


def test_a_record_shorter_than_its_filters(clean):
    with pytest.raises(DataError, match=r"too short.*Record longer"):
        prepare(clean.isel(time=slice(0, 500))).regressors(**OPTIONS)
