import numpy as np
import pandas as pd
import pytest

from ankleloop import DataError, evaluate, identify, new_trial, simulate
from ankleloop.assessment.scores import in_band_snr, parameter_row
from ankleloop.joint.estimate import Estimate
from ankleloop.joint.prepared import prepare
from ankleloop.joint.regressors import torque_dataset
from ankleloop.signals.decimation import decimate

RATE, FACTOR, FIRST = 1000.0, 10, 500


@pytest.fixture(scope="module")
def trial():
    return simulate(seed=3, duration=20.0)


def decimate_variable(trial, name, count=1900):
    return decimate(trial[name].values, FACTOR, FIRST, count)


def make_estimate(intrinsic, reflex, net=None, first=FIRST, **fields):
    """Any torques, as the result of some identification at 100 Hz."""
    time = (first + FACTOR * np.arange(intrinsic.size)) / RATE
    net = intrinsic + reflex if net is None else net
    torque = torque_dataset(time, RATE / FACTOR, net=net, intrinsic=intrinsic, reflex=reflex)
    return Estimate("test", torque, {"K": 150.0, "B": 0.8, "I": 0.015}, {"delay": 0.04}, **fields)


@pytest.fixture(scope="module")
def perfect(trial):
    return make_estimate(
        decimate_variable(trial, "torque_intrinsic"), decimate_variable(trial, "torque_reflex")
    )


def percent_vaf(signal, error):
    """Equation 18, written out."""
    signal, error = signal - signal.mean(), error - error.mean()
    return 100 * (1 - (error @ error) / (signal @ signal))


# --- evaluate


def test_each_row_has_its_own_pair_of_signals(trial):
    """Estimates that are wrong in three ways are scored each against its own truth."""
    intrinsic, reflex = (
        decimate_variable(trial, "torque_intrinsic"),
        decimate_variable(trial, "torque_reflex"),
    )
    rng = np.random.default_rng(1)
    errors = [0.3 * rng.standard_normal(intrinsic.size) for _ in range(3)]
    estimate = make_estimate(
        intrinsic + errors[0], reflex + 2 * errors[1], net=intrinsic + reflex + 4 * errors[2]
    )
    inside = slice(100, -100)
    measured = decimate_variable(trial, "torque")
    expected = [
        percent_vaf(measured[inside], (measured - estimate.torque["net"].values)[inside]),
        percent_vaf((intrinsic + reflex)[inside], 4 * errors[2][inside]),
        percent_vaf(intrinsic[inside], errors[0][inside]),
        percent_vaf(reflex[inside], 2 * errors[1][inside]),
    ]
    np.testing.assert_allclose(evaluate(trial, estimate)["vaf"], expected, atol=1e-9)


def test_rows_without_truths(trial):
    """Without truths every row is against the measured torque, and the rows do not add up."""
    bare = trial.drop_vars([name for name in trial.data_vars if name.startswith("torque_")])
    torque = decimate_variable(bare, "torque")
    table = evaluate(bare, make_estimate(0.25 * torque, 0.5 * torque))
    assert list(table.columns) == ["torque", "against", "vaf"]
    rows = [("net", "measured"), ("intrinsic", "measured"), ("reflex", "measured")]
    assert list(table[["torque", "against"]].itertuples(index=False, name=None)) == rows
    np.testing.assert_allclose(
        table["vaf"], 100 * (1 - np.array([0.25, 0.75, 0.5]) ** 2), atol=1e-10
    )


def test_a_path_without_torque_is_not_scored():
    trial = simulate(seed=3, duration=20.0, reflex_gain=0.0)
    table = evaluate(
        trial, make_estimate(decimate_variable(trial, "torque_intrinsic"), np.zeros(1900))
    )
    assert table["torque"].tolist() == ["net", "net", "intrinsic"]


@pytest.mark.parametrize(("trim", "samples"), [(1.0, 100), (0.0, 0), (0.255, 26), (5.005, 501)])
def test_trimming(trial, perfect, trim, samples):
    """Errors at the ends do not count, the first one inside does."""
    default = {} if trim == 1.0 else {"trim": trim}
    intrinsic, reflex = (perfect.torque[part].values.copy() for part in ("intrinsic", "reflex"))
    if samples:
        intrinsic[:samples] = 1e3
        intrinsic[-samples:] = np.nan
    scores = evaluate(trial, make_estimate(intrinsic, reflex), **default).set_index(
        ["torque", "against"]
    )["vaf"]
    assert scores["intrinsic", "true"] == pytest.approx(100.0, abs=1e-10)
    for sample in (samples, -samples - 1):
        intrinsic = perfect.torque["intrinsic"].values.copy()
        intrinsic[sample] += 100.0
        scores = evaluate(trial, make_estimate(intrinsic, reflex), **default).set_index(
            ["torque", "against"]
        )["vaf"]
        assert scores["intrinsic", "true"] < 80


def test_an_estimate_shorter_than_the_trim(trial):
    with pytest.raises(
        DataError, match=r"the estimate covers 1\.99 s; nothing is left after a trim of 1 s"
    ):
        evaluate(trial, make_estimate(*np.ones((2, 200))))


# --- in-band SNR


def test_in_band_snr_of_known_sinusoids():
    """Two tones in the pass band and one in the stop band: the powers are known."""
    t = np.arange(20_000) / RATE
    slow, medium, fast = (np.sin(2 * np.pi * f * t) for f in (2.0, 5.0, 80.0))
    trial = new_trial(
        0.01 * slow,
        slow,
        RATE,
        torque_intrinsic=3.0 * slow,
        torque_reflex=4.0 * slow,
        torque_noise=0.5 * medium + 9 * fast,
    )
    torque = slow[FIRST : FIRST + 19_000 : FACTOR]
    # Whole periods remain after the trim, to within a sample.
    assert in_band_snr(prepare(trial), make_estimate(torque, torque)) == pytest.approx(
        20 * np.log10(7.0 / 0.5), abs=0.01
    )


# --- tables


def test_parameters_of_an_estimate(trial):
    estimate = identify(trial, "pr-moesp", basis="rectifier")
    row = parameter_row(trial, estimate)
    for name, value in {**estimate.stiffness, **estimate.reflex}.items():
        assert row[name] == value
    assert row["in_band_snr_db"] == in_band_snr(prepare(trial), estimate)
    assert row["spectral_radius"] == pytest.approx(np.abs(estimate.model.poles()).max())
    assert (row["order"], row["stable"], row["reference"], row["warnings"]) == (
        2,
        True,
        "reference",
        "",
    )


def test_truths_can_be_ignored():
    trial = simulate(seed=1, duration=15.0)
    estimate = identify(trial, "pr-moesp")
    recording = trial.drop_vars([name for name in trial.data_vars if name.startswith("torque_")])
    table = evaluate(trial, estimate, against="measured")
    pd.testing.assert_frame_equal(table, evaluate(recording, estimate))
    assert set(table["against"]) == {"measured"}
    with pytest.raises(ValueError, match="against must be one of 'measured' or None"):
        evaluate(trial, estimate, against="true")


@pytest.mark.parametrize(
    ("settings", "truth"),
    [
        ({"zeta": 0.6}, np.exp(0.4 * np.array([-0.6 + 0.8j, -0.6 - 0.8j]))),
        ({"zeta": 1.25, "pole": 60.0}, np.exp(0.01 * np.array([-20.0, -80.0, -60.0]))),
    ],
)
def test_the_error_of_the_poles_is_their_largest_distance_from_the_true_ones(settings, truth):
    trial = simulate(seed=1, duration=20.0, **settings)

    def row(poles):
        return parameter_row(
            trial, make_estimate(*np.ones((2, 1900)), diagnostics={"poles": poles})
        )

    moved = truth[::-1] + 0.01 * np.arange(truth.size)  # in another order
    assert row(moved)["pole_error"] == pytest.approx(0.01 * (truth.size - 1), rel=1e-9)
    assert "pole_error" not in row(truth[1:])  # a model of another order
    assert row(moved)["spectral_radius_true"] == pytest.approx(np.abs(truth).max(), rel=1e-9)
