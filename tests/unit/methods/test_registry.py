import control
import numpy as np
import pytest

import ankleloop
from ankleloop import DataError, evaluate, identify, segment, simulate, vaf
from ankleloop.joint.estimate import save_estimates
from ankleloop.joint.regressors import build_regressors
from ankleloop.methods.moesp import MEMBERS

TRUE_POLES = np.poly([np.exp(-0.4), np.exp(-0.4)])  # two at 40 rad/s, at 100 Hz
WITHOUT_REFERENCE = ("eiv-moesp", "pi-moesp", "po-moesp", "moesp", "parallel-cascade")


@pytest.fixture(scope="module")
def clean():
    """Trials without noise, by reflex gain."""
    return {gain: simulate(seed=1, reflex_gain=gain, voluntary=0.0, snr_db=None) for gain in (2.0, 13.0)}


@pytest.fixture(scope="module")
def noisy():
    return simulate(seed=1, duration=20.0)


def scores(trial, estimate):
    return ankleloop.evaluate(trial, estimate).set_index(["torque", "against"])["vaf"]


def regressors_of(trial, basis, degree=5):
    return build_regressors(trial, delay=0.04, basis=basis, degree=degree, identification_rate=100.0)


# --- recovery of the truth


def assert_joint(estimate, gain):
    """K = 150, B = 0.8, I = 0.015 and a double pole at 40 rad/s."""
    assert estimate.stiffness["K"] == pytest.approx(150.0, rel=0.005)
    assert estimate.stiffness["I"] == pytest.approx(0.015, rel=0.005)
    assert estimate.stiffness["B"] == pytest.approx(0.8, rel=0.015)
    np.testing.assert_allclose(np.poly(estimate.model.poles()), TRUE_POLES, atol=0.01)
    assert estimate.reflex["G"] == pytest.approx(gain, rel=0.005)
    assert estimate.reflex["omega_n"] == pytest.approx(40.0, rel=0.01)
    assert estimate.reflex["zeta"] == pytest.approx(1.0, rel=0.01)
    assert estimate.reflex["delay"] == 0.04


@pytest.mark.parametrize(
    ("method", "options"),
    [(method, {}) for method in MEMBERS]
    + [("pr-moesp", {"projection": "correlation"}), ("pr-moesp", {"input_matrices": "instruments"})],
    ids=[*MEMBERS, "pr-moesp-correlation", "pr-moesp-instruments"],
)
@pytest.mark.parametrize("gain", [2.0, 13.0])
def test_a_rectifier_recovers_the_joint_without_noise(clean, gain, method, options):
    estimate = identify(clean[gain], method, basis="rectifier", **options)
    assert_joint(estimate, gain)
    result = scores(clean[gain], estimate)
    assert result["net", "measured"] >= 99.99
    assert result["net", "true"] >= 99.99
    assert result["intrinsic", "true"] >= 99.99
    assert result["reflex", "true"] >= 99.99


@pytest.mark.parametrize("gain", [2.0, 13.0])
def test_splines_recover_the_torques_without_noise(clean, gain):
    estimate = identify(clean[gain], basis="spline", degree=8)
    result = scores(clean[gain], estimate)
    assert result.min() >= 99.99
    assert estimate.stiffness["K"] == pytest.approx(150.0, rel=0.005)
    np.testing.assert_allclose(np.poly(estimate.model.poles()), TRUE_POLES, atol=0.01)


def test_a_polynomial_is_not_a_rectifier(clean):
    """Degree 5 leaves about half a percent of the net torque, and nine points in ten of it in the reflex."""
    result = scores(clean[13.0], identify(clean[13.0], basis="chebyshev"))
    assert 99.0 < result["net", "true"] < 99.9
    assert 97.0 < result["reflex", "true"] < 99.5


def test_the_third_order_form_of_the_reflex():
    trial = simulate(seed=1, voluntary=0.0, snr_db=None, pole=20.0)
    second, third = (identify(trial, basis="rectifier", order=order) for order in (2, 3))
    expected = np.poly([np.exp(-0.4), np.exp(-0.4), np.exp(-0.2)])
    np.testing.assert_allclose(np.poly(third.model.poles()), expected, atol=0.01)
    assert scores(trial, third).min() >= 99.99
    assert scores(trial, second)["reflex", "true"] < 99.95
    assert third.reflex["G"] == pytest.approx(13.0, rel=0.005)
    assert third.stiffness["K"] == pytest.approx(150.0, rel=0.005)


def test_the_order_is_found_without_noise(clean):
    assert identify(clean[13.0], basis="rectifier", order=None).diagnostics["order"] == 2


def test_another_delay_is_noticed(clean):
    """The delay of the simulation is 40 ms: no other explains as much."""
    net = {d: scores(clean[13.0], identify(clean[13.0], basis="rectifier", delay=d))["net", "true"] for d in
           (0.03, 0.04, 0.05)}  # fmt: skip
    assert max(net, key=net.get) == 0.04


@pytest.mark.parametrize("rate", [50.0, 200.0])
def test_other_identification_rates(clean, rate):
    estimate = identify(clean[13.0], basis="rectifier", identification_rate=rate)
    assert estimate.model.dt == 1 / rate
    assert estimate.stiffness["K"] == pytest.approx(150.0, rel=0.02)
    assert scores(clean[13.0], estimate)["net", "true"] > 99.9


# --- what every method returns


@pytest.mark.parametrize("method", ankleloop.METHODS)
def test_every_method_returns_a_valid_estimate(noisy, method, tmp_path):
    before = noisy.copy(deep=True)
    estimate = identify(noisy, method)
    assert noisy.identical(before)
    assert isinstance(estimate, ankleloop.Estimate)
    assert estimate.method == method

    torque = estimate.torque
    assert set(torque.data_vars) == {"net", "intrinsic", "reflex"}
    assert torque.attrs["identification_rate"] == 100.0
    assert torque["time"].attrs["units"] == "s"
    np.testing.assert_allclose(np.diff(torque["time"]), 0.01, rtol=1e-9)
    assert torque["time"][0] >= 0
    assert torque["time"][-1] < 20.0
    assert torque.sizes["time"] > 1800
    for variable in torque.data_vars.values():
        assert variable.dims == ("time",)
        assert variable.dtype == np.float64
        assert variable.attrs["units"] == "N·m"
        assert np.all(np.isfinite(variable))
    np.testing.assert_allclose(torque["net"], torque["intrinsic"] + torque["reflex"], atol=1e-12)

    assert set(estimate.stiffness) == {"K", "B", "I"}
    assert np.all(np.isfinite(list(estimate.stiffness.values())))
    # A PRBS is what the real-time algorithm must not be given.
    assert estimate.stiffness["K"] == pytest.approx(150.0, rel=0.6 if method == "real-time" else 0.25)
    assert estimate.reflex["delay"] == 0.04
    assert all(isinstance(value, float) and np.isfinite(value) for value in estimate.reflex.values())
    assert isinstance(estimate.diagnostics["warnings"], list)
    assert method in repr(estimate)
    assert "N·m/rad" in repr(estimate)
    save_estimates([estimate], tmp_path / "estimate.nc")

    result = scores(noisy, estimate)
    assert result["net", "measured"] > 85.0
    assert result["net", "true"] > 95.0


@pytest.mark.parametrize("method", ankleloop.METHODS)
def test_models_are_named_and_in_physical_units(noisy, method):
    model = identify(noisy, method).model
    if model is None:
        assert method not in MEMBERS
        return
    assert isinstance(model, control.StateSpace)
    assert model.dt == pytest.approx(0.01)
    assert model.output_labels == ["torque"]
    assert model.input_labels[:3] == ["position", "velocity", "acceleration"]
    assert model.ninputs == len(model.input_labels) > 3


@pytest.mark.parametrize(
    ("basis", "degree", "terms"),
    [
        ("chebyshev", 5, [f"chebyshev_{k}" for k in range(1, 6)]),
        ("rectifier", 1, ["rectified_velocity"]),
        ("spline", 6, [f"spline_{k}" for k in range(1, 7)]),
    ],
)
@pytest.mark.parametrize("free_b", [False, True])
@pytest.mark.parametrize("method", MEMBERS)
def test_the_model_reproduces_the_torques(noisy, method, basis, degree, terms, free_b):
    estimate = identify(noisy, method, basis=basis, degree=degree, free_b=free_b)
    regressors = regressors_of(noisy, basis, degree)
    model = estimate.model
    assert model.input_labels == ["position", "velocity", "acceleration", *terms] == list(regressors.names)
    u = (regressors.inputs - regressors.inputs.mean(axis=0)).T
    # From here on nothing is left of the initial state.
    start = int(np.log(1e-13) / np.log(np.max(np.abs(model.poles()))))
    assert start < 1500
    for torque, used in (("net", slice(None)), ("intrinsic", slice(0, 3)), ("reflex", slice(3, None))):
        inputs = np.zeros_like(u)
        inputs[used] = u[used]
        simulated = control.forced_response(model, inputs=inputs).outputs[0]
        actual = estimate.torque[torque].values[start:]
        # Deviations from the mean: a constant makes no difference.
        np.testing.assert_allclose(
            actual - actual.mean(), simulated[start:] - simulated[start:].mean(), atol=1e-7, err_msg=torque
        )
    np.testing.assert_allclose(estimate.torque["time"], regressors.time, rtol=1e-14)
    stiffness = [estimate.stiffness[name] for name in "KBI"]
    if free_b:  # what P, Ṗ and P̈ do through the state counts as well
        u, intrinsic = u[:3].T, estimate.torque["intrinsic"].values
        np.testing.assert_allclose(stiffness, np.linalg.lstsq(u, intrinsic, rcond=None)[0], rtol=1e-6)
    else:
        assert stiffness == model.D[0, :3].tolist()


@pytest.mark.parametrize("method", MEMBERS)
def test_only_the_reflex_has_a_state_unless_b_is_free(noisy, method):
    fixed, free = (identify(noisy, method, basis="rectifier", free_b=free_b).model for free_b in (False, True))
    np.testing.assert_array_equal(fixed.B[:, :3], 0.0)
    assert np.all(fixed.B[:, 3] != 0)
    assert np.all(free.B != 0)


@pytest.mark.parametrize("basis", ["rectifier", "spline"])
def test_free_b_still_separates_the_torques(clean, basis):
    """Without noise the joint is a special case of the model with free B: its parts must not drift apart."""
    estimate = identify(clean[13.0], basis=basis, degree=8, free_b=True)
    result = scores(clean[13.0], estimate)
    assert result["net", "true"] >= 99.9
    assert result["intrinsic", "true"] >= 99.0
    assert result["reflex", "true"] >= 99.0
    assert estimate.stiffness["K"] == pytest.approx(150.0, rel=0.05)


@pytest.mark.parametrize("method", ankleloop.METHODS)
def test_torques_are_deviations_from_their_means(noisy, method):
    for name, torque in identify(noisy, method).torque.items():
        assert abs(float(torque.mean())) < 1e-9, name


def test_free_b_explains_no_less(noisy):
    """The model without free_b is a special case of the one with it."""
    fixed, free = (identify(noisy, basis="rectifier", free_b=free_b) for free_b in (False, True))
    torque = regressors_of(noisy, "rectifier").torque
    assert vaf(torque, free.torque["net"].values) > vaf(torque, fixed.torque["net"].values)


def test_the_default_method_is_the_one_of_the_paper(noisy):
    np.testing.assert_array_equal(identify(noisy).torque["net"], identify(noisy, "pr-moesp").torque["net"])
    diagnostics = identify(noisy).diagnostics
    assert diagnostics["instruments"] == "past-reference"
    assert diagnostics["projection"] == "ordinary"
    assert diagnostics["input_matrices"] == "least-squares"
    assert diagnostics["order"] == 2
    assert diagnostics["instrument_rows"] == 15


@pytest.mark.parametrize(
    ("method", "instruments", "projection"),
    [
        ("pr-moesp", "past-reference", "ordinary"),
        ("eiv-moesp", "past-input-output", "correlation"),
        ("pi-moesp", "past-input", "ordinary"),
        ("po-moesp", "past-input-output", "ordinary"),
        ("moesp", "none", "ordinary"),
    ],
)
def test_members_differ_in_their_instruments(noisy, method, instruments, projection):
    diagnostics = identify(noisy, method, basis="rectifier").diagnostics
    assert (diagnostics["instruments"], diagnostics["projection"]) == (instruments, projection)


@pytest.mark.parametrize("order", [2, 3])
def test_the_correlation_form_takes_enough_instruments_by_itself(noisy, order):
    diagnostics = identify(noisy, basis="rectifier", projection="correlation", order=order).diagnostics
    assert diagnostics["instrument_rows"] >= 4 * 15 + order


def test_the_linear_term_of_a_polynomial_repeats_the_velocity(clean):
    """T₁ is the velocity 4 samples late: of its 15 Hankel rows 11 are in those of the velocity, to filter errors."""
    diagnostics = identify(clean[13.0], basis="chebyshev", degree=1, order=1).diagnostics
    assert diagnostics["rank"] <= 4 * 15 - 11
    assert diagnostics["condition"] < 1e5


def test_high_orders_are_guarded(noisy):
    estimate = identify(noisy, "pi-moesp", basis="rectifier", order=6)
    assert not estimate.diagnostics["stable"]
    assert np.max(np.abs(estimate.model.poles())) < 1
    (warning,) = estimate.diagnostics["warnings"]
    assert "unstable A (spectral radius 1.0" in warning
    assert "order 6" in warning
    assert warning in repr(estimate)
    assert scores(noisy, estimate)["net", "measured"] > 90


# --- the reference


def test_a_missing_reference_is_refused(noisy):
    bare = noisy.drop_vars("reference")
    for method, options in (("pr-moesp", {}), ("pi-moesp", {"input_matrices": "instruments"})):
        message = "the trial has no variable 'reference' to serve as reference; it has position, torque"
        with pytest.raises(DataError, match=message):
            identify(bare, method, **options)
    with pytest.raises(DataError, match=r"has no variable 'command' to serve as reference; it has .*reference='positi"):
        identify(noisy, reference="command")


@pytest.mark.parametrize("method", WITHOUT_REFERENCE)
def test_other_methods_need_no_reference(noisy, method):
    without = identify(noisy.drop_vars("reference"), method)
    np.testing.assert_array_equal(without.torque["net"], identify(noisy, method).torque["net"])
    assert "reference" not in without.diagnostics


@pytest.mark.parametrize("options", [{}, {"input_matrices": "instruments"}])
def test_the_position_serves_as_reference_of_an_open_loop_record(options):
    trial = simulate(seed=1, duration=20.0, closed_loop=False, voluntary=0.0, snr_db=None).drop_vars("reference")
    estimate = identify(trial, basis="rectifier", reference="position", **options)
    assert estimate.diagnostics["reference"] == "position"
    assert_joint(estimate, 13.0)
    assert scores(trial, estimate).min() >= 99.99


def test_a_reference_is_marked(noisy):
    assert identify(noisy, basis="rectifier").diagnostics["reference"] == "reference"
    assert "reference" not in identify(noisy, "pi-moesp", basis="rectifier").diagnostics


# --- refusals


@pytest.mark.parametrize("method", ankleloop.METHODS)
def test_an_unknown_option_names_those_there_are(noisy, method):
    with pytest.raises(TypeError, match=f"method '{method}' has no option 'ordre'; it has ") as e:
        identify(noisy, method, ordre=3)
    for name in ankleloop.method_options(method):
        assert name in str(e.value)
    assert "method" not in ankleloop.method_options(method)


def test_an_unknown_method_names_those_there_are(noisy):
    for call in (lambda: identify(noisy, "magic"), lambda: ankleloop.method_options("magic")):
        with pytest.raises(ValueError, match="unknown method 'magic'; known: ") as e:
            call()
        for name in ankleloop.METHODS:
            assert name in str(e.value)


def test_the_registry_cannot_be_changed():
    with pytest.raises(TypeError):
        ankleloop.METHODS["magic"] = None


@pytest.mark.parametrize("method", ankleloop.METHODS)
@pytest.mark.parametrize("name", ["position", "torque"])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_missing_samples_are_refused(noisy, method, name, value):
    broken = noisy.copy(deep=True)
    broken[name][777] = value
    with pytest.raises(DataError, match=rf"{name} is not finite at sample 777 \(0.777 s\)"):
        identify(broken, method)


@pytest.mark.parametrize("method", ankleloop.METHODS)
@pytest.mark.parametrize("name", ["position", "torque"])
def test_constant_channels_are_refused(noisy, method, name):
    broken = noisy.copy(deep=True)
    broken[name][:] = 0.25
    with pytest.raises(DataError, match=f"{name} is constant"):
        identify(broken, method)


@pytest.mark.parametrize("method", ankleloop.METHODS)
@pytest.mark.parametrize("samples", [2, 100, 500, 1200])
def test_short_records_are_refused(noisy, method, samples):
    with pytest.raises(DataError, match=r"too short|shorter|record longer|Record longer"):
        identify(noisy.isel(time=slice(0, samples)), method)


@pytest.mark.parametrize("method", ankleloop.METHODS)
@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"identification_rate": 300.0}, DataError, r"1000 Hz\) is not a whole multiple of the identification rate"),
        ({"identification_rate": 0.0}, DataError, "identification_rate must be positive"),
        ({"delay": -0.01}, ValueError, "delay must be a time between 0 and 1 s"),
        ({"basis": "fourier"}, ValueError, "basis"),
    ],
)
def test_impossible_options_are_refused(noisy, method, options, error, message):
    if not set(options) <= set(ankleloop.method_options(method)):
        pytest.skip(f"{method} does not have {', '.join(options)}")
    with pytest.raises(error, match=message):
        identify(noisy, method, **options)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"order": 15}, r"block_rows must be larger than the order \(15\), got 15"),
        ({"order": 0}, "order must be at least 1, got 0"),
        ({"projection": "oblique"}, "unknown projection 'oblique'; known: ordinary, correlation"),
        ({"input_matrices": "guess"}, "unknown input_matrices 'guess'; known: least-squares, instruments"),
        ({"basis": "spline", "degree": 3}, "a cubic spline basis needs a degree of at least 4, got 3"),
        ({"delay": None}, r"delay must be a time .* \(this method does not estimate it\), got None"),
    ],
)
def test_impossible_options_of_the_family_are_refused(noisy, options, message):
    with pytest.raises(ValueError, match=message):
        identify(noisy, **options)


# --- the parallel cascade

AHEAD, BEHIND = 4, 50  # ± 40 ms and 0 … 0.5 s at 100 Hz


class Lagged:
    """Lagged position and rectified velocity, and the torque they are to explain, all centred."""

    def __init__(self, trial):
        regressors = regressors_of(trial, "rectifier", 1)
        position, rectified, torque = regressors.inputs[:, 0], regressors.inputs[:, 3], regressors.torque
        self.rows = range(BEHIND, torque.size - AHEAD)
        self.time = regressors.time[BEHIND : torque.size - AHEAD]
        self.intrinsic = self.centred([[position[t - lag] for lag in range(-AHEAD, AHEAD + 1)] for t in self.rows])
        self.reflex = self.centred([[rectified[t - lag] for lag in range(BEHIND + 1)] for t in self.rows])
        self.torque = self.centred(torque[self.rows])

    @staticmethod
    def centred(x):
        return np.asarray(x) - np.mean(x, axis=0)

    @staticmethod
    def fit(lags, target):
        return np.linalg.lstsq(lags, target, rcond=None)[0]

    def joint(self):
        """Both impulse responses at once, without alternation."""
        return np.split(self.fit(np.hstack([self.intrinsic, self.reflex]), self.torque), [2 * AHEAD + 1])

    def net_vaf(self, residual):
        return 100 * (1 - residual @ residual / (self.torque @ self.torque))


@pytest.fixture(scope="module")
def cascades(clean, noisy):
    return {name: (trial, Lagged(trial)) for name, trial in (("clean", clean[13.0]), ("noisy", noisy))}


@pytest.mark.parametrize("record", ["clean", "noisy"])
def test_the_parallel_cascade_converges_to_joint_least_squares(cascades, record):
    trial, lagged = cascades[record]
    intrinsic, reflex = lagged.joint()
    best = lagged.net_vaf(lagged.torque - lagged.intrinsic @ intrinsic - lagged.reflex @ reflex)
    usual = identify(trial, "parallel-cascade")
    assert usual.diagnostics["converged"]
    assert 0 <= best - usual.diagnostics["history"][-1] < 1e-3  # the default tolerance, in points
    fine = identify(trial, "parallel-cascade", tolerance=1e-12)
    assert best == pytest.approx(fine.diagnostics["history"][-1], abs=1e-9)
    np.testing.assert_allclose(fine.torque["intrinsic"], lagged.intrinsic @ intrinsic, atol=2e-4)
    np.testing.assert_allclose(fine.torque["reflex"], lagged.reflex @ reflex, atol=2e-4)
    np.testing.assert_allclose(fine.torque["time"], lagged.time, rtol=1e-14)


@pytest.mark.parametrize("record", ["clean", "noisy"])
@pytest.mark.parametrize("passes", [1, 3])
def test_passes_of_the_parallel_cascade(cascades, record, passes):
    """Intrinsic first, then reflex, each by ordinary least squares."""
    trial, lagged = cascades[record]
    reflex, history = np.zeros_like(lagged.torque), []
    for _ in range(passes):
        intrinsic_response = lagged.fit(lagged.intrinsic, lagged.torque - reflex)
        intrinsic = lagged.intrinsic @ intrinsic_response
        reflex_response = lagged.fit(lagged.reflex, lagged.torque - intrinsic)
        reflex = lagged.reflex @ reflex_response
        history.append(lagged.net_vaf(lagged.torque - intrinsic - reflex))
    estimate = identify(trial, "parallel-cascade", max_passes=passes)
    seen = estimate.diagnostics
    assert seen["passes"] == len(seen["history"]) == passes
    assert not seen["converged"]
    assert seen["warnings"] == []
    np.testing.assert_allclose(seen["history"], history, atol=1e-9)
    np.testing.assert_allclose(estimate.torque["intrinsic"], intrinsic, atol=1e-8)
    np.testing.assert_allclose(estimate.torque["reflex"], reflex, atol=1e-8)
    for name, response in (("intrinsic_response", intrinsic_response), ("reflex_response", reflex_response)):
        np.testing.assert_allclose(seen[name], response, rtol=1e-6, atol=1e-6 * np.max(np.abs(response)))
    np.testing.assert_allclose(seen["intrinsic_lags"], np.arange(-AHEAD, AHEAD + 1) / 100)
    np.testing.assert_allclose(seen["reflex_lags"], np.arange(BEHIND + 1) / 100)


@pytest.mark.parametrize("gain", [2.0, 13.0])
def test_every_pass_gains(clean, gain):
    history = identify(clean[gain], "parallel-cascade", tolerance=1e-6).diagnostics["history"]
    assert len(history) > 5
    assert np.all(np.diff(history) > 0)
    assert np.all(np.diff(history)[:-1] >= 1e-6)
    assert np.diff(history)[-1] < 1e-6


@pytest.mark.parametrize("gain", [2.0, 13.0])
def test_the_converged_parallel_cascade_has_no_bias_without_noise(clean, gain):
    estimate = identify(clean[gain], "parallel-cascade", tolerance=1e-6)
    assert scores(clean[gain], estimate).min() >= 99.9
    assert estimate.stiffness["K"] == pytest.approx(150.0, rel=0.01)
    assert estimate.stiffness["I"] == pytest.approx(0.015, rel=0.01)
    assert estimate.reflex["G"] == pytest.approx(gain, rel=0.01)


def test_the_first_pass_is_biased_in_closed_loop(clean):
    first = scores(clean[13.0], identify(clean[13.0], "parallel-cascade", max_passes=1))
    assert first["intrinsic", "true"] < 70
    assert first["reflex", "true"] < 75


def minimum_description_length(lags, target):
    """Fit with the directions of the lagged inputs that shorten the description most, by trying every number."""
    directions = np.linalg.svd(lags, full_matrices=False)[0]
    strongest = sorted(range(directions.shape[1]), key=lambda k: -abs(directions[:, k] @ target))
    cost, fits = [], []
    for terms in range(1, len(strongest) + 1):
        chosen = directions[:, strongest[:terms]]
        fits.append(chosen @ np.linalg.lstsq(chosen, target, rcond=None)[0])
        cost.append(np.sum((target - fits[-1]) ** 2) * (1 + terms * np.log(target.size) / target.size))
    return fits[int(np.argmin(cost))], int(np.argmin(cost)) + 1


def test_rank_by_minimum_description_length(cascades):
    trial, lagged = cascades["noisy"]
    intrinsic, few = minimum_description_length(lagged.intrinsic, lagged.torque)
    reflex, fewer = minimum_description_length(lagged.reflex, lagged.torque - intrinsic)
    assert few <= 2 * AHEAD + 1
    assert fewer < BEHIND + 1
    estimate = identify(trial, "parallel-cascade", max_passes=1, rank="mdl")
    np.testing.assert_allclose(estimate.torque["intrinsic"], intrinsic, atol=1e-8)
    np.testing.assert_allclose(estimate.torque["reflex"], reflex, atol=1e-8)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"rank": "half"}, "unknown rank 'half'; known: full, mdl"),
        ({"basis": "chebyshev"}, "the parallel cascade has one reflex input: basis must be 'rectifier', got 'cheb"),
        ({"max_passes": 0}, "max_passes must be at least 1, or None to run to convergence; got 0"),
    ],
)
def test_impossible_options_of_the_parallel_cascade(noisy, options, message):
    with pytest.raises(ValueError, match=message):
        identify(noisy, "parallel-cascade", **options)


def test_responses_longer_than_the_record_are_refused(noisy):
    with pytest.raises(DataError, match=r"leaves \d+ samples for 2010 unknowns: record longer, or shorten"):
        identify(noisy, "parallel-cascade", reflex_lags=20.0)


def test_short_trials_are_merged():
    """Ten records of five seconds say what one of fifty does, and no joint is seen across their seams."""
    whole = simulate(seed=1, snr_db=None, voluntary=0.0)
    parts = [segment(whole, 5.0 * k, 5.0 * (k + 1)) for k in range(10)]
    estimates = identify(parts, "pr-moesp", basis="rectifier")
    assert len(estimates) == 10
    assert all(e.stiffness == estimates[0].stiffness for e in estimates)
    assert estimates[0].stiffness["K"] == pytest.approx(150.0, rel=2e-3)
    assert estimates[0].reflex["G"] == pytest.approx(13.0, rel=5e-3)
    for part, estimate in zip(parts, estimates, strict=True):
        assert evaluate(part, estimate, trim=0.0).query("torque == 'net'")["vaf"].min() > 99.9
    # Joined end to end as if they were one record, in another order, they are another record.
    shuffled = [parts[k] for k in (3, 8, 1, 6, 0, 9, 4, 7, 2, 5)]
    again = identify(shuffled, "pr-moesp", basis="rectifier")
    assert again[0].stiffness["K"] == pytest.approx(estimates[0].stiffness["K"], rel=1e-6)


def test_merging_has_its_limits():
    parts = [simulate(seed=seed, duration=8.0) for seed in range(3)]
    merged = identify(parts, "pr-moesp", basis="chebyshev", input_matrices="instruments")
    assert len({id(e.matrices) for e in merged}) == 1
    with pytest.raises(
        DataError, match="parallel-cascade identifies one trial at a time; trials are merged by pr-moesp"
    ):
        identify(parts, "parallel-cascade")
    with pytest.raises(DataError, match="no trials"):
        identify([], "pi-moesp")
