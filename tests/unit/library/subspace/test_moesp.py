import ctrlsys
import numpy as np
import pytest
from scipy import signal as sps

from ankleloop.errors import DataError
from ankleloop.subspace import moesp

MEMBERS = ("none", "past-input", "past-input-output", "past-reference")
FREQUENCIES = np.linspace(0.0, np.pi, 50)


def random_model(rng, order, inputs, outputs, radius=0.9):
    A = rng.standard_normal((order, order))
    A *= radius / np.max(np.abs(np.linalg.eigvals(A)))
    B, C = rng.standard_normal((order, inputs)), rng.standard_normal((outputs, order))
    return A, B, C, rng.standard_normal((outputs, inputs))


def simulate(model, u):
    return sps.dlsim((*model, 1.0), u)[1].reshape(u.shape[0], -1)


def frequency_response(A, B, C, D):
    """C (zI - A)^-1 B + D around the unit circle."""
    return np.array(
        [C @ np.linalg.solve(np.exp(1j * w) * np.eye(A.shape[0]) - A, B) + D for w in FREQUENCIES]
    )


def matrices(estimate):
    return estimate.model.A, estimate.model.B, estimate.model.C, estimate.model.D


def assert_same_transfer_function(model, truth, rtol):
    expected = frequency_response(*truth)
    np.testing.assert_allclose(
        frequency_response(*model), expected, atol=rtol * np.max(np.abs(expected))
    )


def pole_distance(A, truth):
    """Largest distance between corresponding poles."""
    poles, expected = (np.sort_complex(np.linalg.eigvals(A)) for A in (A, truth))
    return np.max(np.abs(poles - expected))


# --- against SLICOT


def run_slicot(u, y, block_rows, order, method="C"):
    """A, B, C, D by SLICOT's IB01AD and IB01BD, its MOESP ("M", A and C only) or combined method ("C")."""
    m, p, samples = u.shape[1], y.shape[1], u.shape[0]
    u, y = (np.array(x, order="F") for x in (u, y))
    _, r, _, _, info = ctrlsys.ib01ad(
        "M", "Q", "N", "O", "N", "N", block_rows, m, p, u, y, 0.0, -1.0
    )
    assert info == 0
    A, C, B, D, *_, info = ctrlsys.ib01bd(
        method, "A", "N", block_rows, order, m, p, samples, r, 0.0
    )
    assert info == 0
    return A, B, C, D


OPEN_LOOP = [(4, 3, 2), (2, 8, 1), (2, 1, 1)]


def simulate_open_loop(order, inputs, outputs, snr_db, samples=5000, seed=0):
    rng = np.random.default_rng(seed)
    truth = random_model(rng, order, inputs, outputs)
    u = rng.standard_normal((samples, inputs))
    clean = simulate(truth, u)
    noise = (
        0.0
        if snr_db is None
        else clean.std(axis=0) * 10 ** (-snr_db / 20) * rng.standard_normal(clean.shape)
    )
    return truth, u, clean, clean + noise


@pytest.mark.parametrize("sizes", OPEN_LOOP)
@pytest.mark.parametrize("instruments", MEMBERS[:3])
def test_poles_of_slicot_without_noise(sizes, instruments):
    _, u, y, _ = simulate_open_loop(*sizes, snr_db=None)
    expected = run_slicot(u, y, 15, sizes[0])
    estimate = moesp(u, y, 15, sizes[0], instruments)
    assert pole_distance(estimate.model.A, expected[0]) < 1e-8
    assert_same_transfer_function(matrices(estimate), expected, 1e-8)


@pytest.mark.parametrize("sizes", OPEN_LOOP)
def test_past_inputs_and_outputs_are_the_moesp_of_slicot(sizes):
    """SLICOT's MOESP has the same instruments; only the removal of means is not the same."""
    _, u, _, y = simulate_open_loop(*sizes, snr_db=10.0)
    y = y / y.std(axis=0)  # as channels are weighted here
    u, y = u - u.mean(axis=0), y - y.mean(axis=0)
    expected = run_slicot(u, y, 15, sizes[0], method="M")[0]
    estimate = moesp(u, y, 15, sizes[0], "past-input-output")
    assert pole_distance(estimate.model.A, expected) < 2e-5


# --- exact recovery


def simulate_with_reference(samples=1500, seed=1, inputs=2, outputs=2, order=3):
    """Inputs that a reference drives only in part, and outputs with offsets."""
    rng = np.random.default_rng(seed)
    truth = random_model(rng, order, inputs, outputs)
    r = rng.standard_normal((samples, inputs))
    u = sps.lfilter([1.0, 0.6, -0.3], [1.0, -0.5], r, axis=0) + 0.3 * rng.standard_normal(r.shape)
    return truth, u + 5.0, simulate(truth, u + 5.0) - 20.0, r


@pytest.mark.parametrize("input_matrices", ["least-squares", "instruments"])
@pytest.mark.parametrize("projection", ["ordinary", "correlation"])
@pytest.mark.parametrize("instruments", MEMBERS)
def test_exact_recovery(instruments, projection, input_matrices):
    truth, u, y, r = simulate_with_reference()
    options = {"projection": projection, "reference": r, "input_matrices": input_matrices}
    if (instruments, projection) == ("none", "correlation"):
        with pytest.raises(DataError, match="has 0 rows of instruments, but needs at least 19"):
            moesp(u, y, 8, 3, instruments, **options)
        return
    estimate = moesp(u, y, 8, 3, instruments, **options)
    assert_same_transfer_function(matrices(estimate), truth, 1e-8)
    np.testing.assert_allclose(np.poly(estimate.model.poles()), np.poly(truth[0]), atol=1e-8)
    assert estimate.diagnostics["stable"]
    assert estimate.diagnostics["warnings"] == []
    assert estimate.diagnostics["rank"] == 16


@pytest.mark.parametrize("instruments", MEMBERS)
def test_the_order_by_default(instruments):
    truth, u, y, r = simulate_with_reference()
    estimate = moesp(u, y, 12, None, instruments, reference=r)
    assert estimate.diagnostics["order"] == 3
    assert estimate.model.nstates == 3
    assert estimate.singular_values[3] < 1e-9 * estimate.singular_values[2]
    assert_same_transfer_function(matrices(estimate), truth, 1e-8)


# --- the closed loop


def closed_loop(seed, samples=40_000, gain=0.25):
    """Poles 0.75 ± 0.3708j, strongly coloured noise, a random binary reference held 10 samples."""
    rng = np.random.default_rng(seed)
    r = np.repeat(rng.choice([-1.0, 1.0], samples // 10), 10)
    v = sps.lfilter([1.0, 0.9], [1.0, -0.95], 0.5 * rng.standard_normal(samples))
    plant, sensitivity = [0.0, 1.0, 0.5], np.array([1.0, -1.5, 0.7])
    # u = r - gain·y and y = G·u + v, solved for y.
    closed = sensitivity + gain * np.array(plant)
    y = sps.lfilter(plant, closed, r) + sps.lfilter(sensitivity, closed, v)
    return r - gain * y, y, r


PLANT_POLE = np.roots([1.0, -1.5, 0.7]).max()


def upper_pole(estimate):
    poles = estimate.model.poles()
    return poles[np.argmax(poles.imag)]


def compute_rms(errors):
    return np.sqrt(np.mean(np.abs(errors) ** 2))


def test_consistency_in_closed_loop():
    errors = {
        name: []
        for name in ("ordinary", "correlation", "ordinary with leads", "correlation with leads")
    }
    for seed in range(5):
        u, y, r = closed_loop(seed)
        for form in ("ordinary", "correlation"):
            past = moesp(u, y, 6, 2, "past-reference", form, r, instrument_rows=24)
            # Any shift of the reference is a valid instrument: 6 samples on, the same rows reach into the future.
            early = moesp(u[:-6], y[:-6], 6, 2, "past-reference", form, r[6:], instrument_rows=24)
            errors[form].append(upper_pole(past) - PLANT_POLE)
            errors[f"{form} with leads"].append(upper_pole(early) - PLANT_POLE)
    size = {name: compute_rms(values) for name, values in errors.items()}
    assert size["ordinary"] > 0.1
    assert size["correlation"] < size["ordinary"] / 4
    assert size["ordinary with leads"] > 0.2
    assert size["correlation with leads"] < size["ordinary with leads"] / 10
    # A bias, not scatter.
    assert np.abs(np.mean(errors["ordinary"])) > 10 * np.std(errors["ordinary"])


def test_leads_are_rows_of_the_reference_in_the_future():
    u, y, r = closed_loop(0, samples=4000)
    leads = moesp(
        u, y, 6, 2, "past-reference", "correlation", r, instrument_rows=18, instrument_leads=6
    )
    # The same rows as those of a reference that is six samples early, but for six columns.
    early = moesp(u[:-6], y[:-6], 6, 2, "past-reference", "correlation", r[6:], instrument_rows=24)
    assert leads.diagnostics["instrument_rows"] == early.diagnostics["instrument_rows"] == 24
    assert abs(upper_pole(leads) - upper_pole(early)) < 0.02
    assert abs(upper_pole(leads) - PLANT_POLE) < 0.1
    with pytest.raises(
        ValueError, match=r"instrument_leads must be between 0 and block_rows \(6\), got 7"
    ):
        moesp(u, y, 6, 2, "past-reference", "correlation", r, instrument_leads=7)
    with pytest.raises(
        ValueError,
        match="instrument_leads must be 0 unless instruments are made of the reference: with 'past-input'",
    ):
        moesp(u, y, 6, 2, instrument_leads=1)


# --- errors


@pytest.mark.parametrize("level", [0.0, 0.1, -3e5])
@pytest.mark.parametrize("name", ["input", "output", "reference"])
def test_the_error_names_a_constant_channel(name, level):
    _, u, y, r = simulate_with_reference(samples=300)
    data = {"input": u, "output": y, "reference": r}
    data[name][:, 1] = level
    with pytest.raises(
        DataError, match=f"{name} 1 is constant and carries no information: leave it out"
    ):
        moesp(u, y, 5, 2, "past-reference", reference=r)


@pytest.mark.parametrize(
    ("instruments", "projection", "least"),
    [
        ("none", "ordinary", 32 + 7),
        ("past-input", "ordinary", 48 + 15),
        ("past-input-output", "correlation", 64 + 15),
    ],
)
def test_a_record_shorter_than_its_hankel_window(instruments, projection, least):
    _, u, y, _ = simulate_with_reference()
    rows = least - (7 if instruments == "none" else 15)
    message = (
        rf"the record of {least - 1} samples is shorter than its Hankel window: {rows} Hankel rows need at least "
        rf"{least} samples. Record longer, or use fewer block_rows or instrument_rows"
    )
    with pytest.raises(DataError, match=message):
        moesp(u[: least - 1], y[: least - 1], 8, 3, instruments, projection)
    assert moesp(u[:least], y[:least], 8, 3, instruments, projection).model.nstates == 3


# --- the guard


def test_a_projection_beyond_the_memory_is_refused_before_it_begins(monkeypatch):
    monkeypatch.setattr("ankleloop.options._find_memory", lambda: 10**9)
    u, y = np.random.default_rng(0).standard_normal((2, 100_000, 1))
    with pytest.raises(
        ValueError,
        match=r"^moesp: this would need 3\.84 GB of memory, .* 1 GB: use fewer block_rows",
    ):
        moesp(u, y, block_rows=4000, order=2, instruments="past-input", instrument_rows=4649)
