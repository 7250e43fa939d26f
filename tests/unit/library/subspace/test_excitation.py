"""Inputs that do not determine B and D are told from those that do."""

import numpy as np
import pytest

import ankleloop
from ankleloop.subspace import moesp, simulate_response

A = np.array([[0.75, -0.37], [0.37, 0.75]])
B, C, D = np.array([[1.0], [-0.5]]), np.array([[1.0, 0.5]]), np.array([[0.2]])
TIME = np.arange(1000)
POOR = {"a sinusoid": np.sin(0.2 * TIME), "a step": np.sign(TIME)}
RICH = {
    "two sinusoids": np.sin(0.2 * TIME) + np.sin(0.5 * TIME),
    "a step within the record": np.float64(TIME > 300),
    "noise": np.random.default_rng(1).standard_normal(TIME.size),
}


def identify(u, noise=1e-3, **options):
    y = simulate_response(A, B, C, D, u, [1.0, 0.0])
    y += noise * np.random.default_rng(0).standard_normal(y.shape)
    return moesp(u, y, 8, 2, "none", **options)


@pytest.mark.parametrize("noise", [0.0, 1e-3])
@pytest.mark.parametrize("name", POOR)
def test_a_warning_where_the_inputs_do_not_determine_b_and_d(name, noise):
    (warning,) = identify(POOR[name], noise).diagnostics["warnings"]
    assert warning.startswith("the inputs do not determine B and D: their regression has rank ")
    assert "for 6 unknowns" in warning


@pytest.mark.parametrize("name", RICH)
def test_no_warning_where_they_do(name):
    assert identify(RICH[name]).diagnostics["warnings"] == []


def test_a_warning_where_one_input_follows_from_another():
    u = RICH["noise"][:, None]
    y = simulate_response(A, B, C, D, u)
    (warning,) = moesp(np.hstack([u, -3.0 * u]), y, 8, 2, "none").diagnostics["warnings"]
    assert "leave out inputs that follow from others" in warning


def test_short_records_beside_a_long_one_give_no_warning():
    """Their initial states depend on their offsets, but B and D do not."""
    u = [RICH["noise"][:, None], np.ones((2, 1)) * [[1.0], [2.0]]]
    y = [simulate_response(A, B, C, D, part) for part in u]
    estimate = moesp(u, y, 8, 2, "none")
    assert estimate.diagnostics["regression_rank"] < 1 + 2 + 2 * 2 + 2
    assert estimate.diagnostics["warnings"] == []


@pytest.mark.parametrize("input_matrices", ["least-squares", "instruments"])
def test_no_warning_where_a_tolerance_leaves_out_what_depends_by_construction(input_matrices):
    trial = ankleloop.simulate(seed=1, duration=30.0, snr_db=None, voluntary=0.0)
    estimate = ankleloop.identify(trial, "pr-moesp", free_b=True, input_matrices=input_matrices)
    assert not any("B and D" in text for text in estimate.diagnostics["warnings"])
