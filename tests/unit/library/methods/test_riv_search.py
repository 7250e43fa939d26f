"""The search of `riv`: it ends no worse than it began, converges on hard records, and says what a record lacks."""

import numpy as np
import pytest
from scipy import signal

from ankleloop import identify, new_trial, simulate
from ankleloop.joint.prepared import prepare
from ankleloop.methods.riv.equations import Equations, Point
from ankleloop.methods.riv.search import LEAST_GAIN, MOST_REFINEMENTS, solve


def set_up(
    trial,
    *,
    order=2,
    weighting="noise",
    estimate_delay=False,
    basis="rectifier",
    degree=1,
    reference,
):
    """Equations and the start of their search."""
    trial = prepare(trial)
    regressors = trial.regressors(
        delay=0.04, basis=basis, degree=degree, identification_rate=100.0, reference=reference
    )
    equations = Equations([trial], [regressors], weighting)
    return equations, equations.find_start(order, estimate_delay=estimate_delay)


def delay_and_smooth(x, delay, time_constant):
    """First-order response, behind a delay in samples."""
    pole = np.exp(-1e-3 / time_constant)
    return signal.lfilter(
        [1 - pole], [1, -pole], np.concatenate([np.zeros(delay), x[: x.size - delay]])
    )


def make_incomplete_record(path):
    """A record in open loop with a second path that no model here has."""
    trial = simulate(
        seed=4,
        closed_loop=False,
        duration=20.0,
        reflex_gain=8.0,
        omega_n=9.0,
        zeta=0.5,
        snr_db=25.0,
        voluntary=0.02,
    )
    position = trial["position"].values
    velocity = np.gradient(position, 1e-3)
    torque = {
        "viscoelastic": 20.0 * delay_and_smooth(velocity, 0, 0.05),
        "other direction": -15.0 * delay_and_smooth(np.maximum(-velocity, 0.0), 60, 0.1),
        "both directions": 15.0 * delay_and_smooth(np.abs(velocity), 90, 0.25),
    }[path]
    return new_trial(position, trial["torque"].values + torque, 1000.0)


@pytest.mark.parametrize("weighting", ["noise", "flat"])
def test_the_left_side_is_the_slope_of_the_misfit_in_open_loop(weighting):
    """By differences; weights from the noise are smoothed in one and not in the other, so they agree but for that."""
    equations, start = set_up(
        simulate(seed=1, closed_loop=False), weighting=weighting, reference="position"
    )
    point = Point(equations, start)
    relative = np.sqrt(np.diag(point.information))
    slope = []
    for step in 1e-3 * np.diag(1.0 / relative):
        ahead, behind = (Point(equations, start.add(sign * step)).misfit for sign in (1.0, -1.0))
        slope.append((ahead - behind) / (2 * step.sum()))
    expected = -4.0 / equations.band.correlation * point.side
    tolerance = 0.15 if weighting == "noise" else 1e-3
    assert np.linalg.norm((slope - expected) / relative) < tolerance * np.linalg.norm(
        expected / relative
    )


@pytest.mark.parametrize("weighting", ["noise", "flat"])
@pytest.mark.parametrize("reference", ["reference", "position"])
def test_the_full_slope_by_differences(weighting, reference):
    options = {"order": 3, "basis": "spline", "degree": 6, "estimate_delay": True}
    equations, start = set_up(
        simulate(seed=2, duration=20.0), weighting=weighting, reference=reference, **options
    )
    point = Point(equations, start)
    scale, columns = np.sqrt(np.diag(point.information)), []
    for step in 1e-4 * np.diag(1.0 / scale):
        points = [Point(equations, start.add(sign * step)) for sign in (1.0, -1.0)]
        # The level of flat weights is immaterial: it is held, as the slope does.
        levels = [
            1.0 if weighting == "noise" else p.level.mean() / point.level.mean() for p in points
        ]
        ahead, behind = (p.side * level for p, level in zip(points, levels, strict=True))
        columns.append((ahead - behind) / (2 * step.sum()))
    difference = (np.array(columns).T + point.slope) / np.outer(scale, scale)
    assert np.max(np.abs(difference)) < 2e-3 * np.max(np.abs(point.slope / np.outer(scale, scale)))


def check_path(solution):
    """No point has both a larger left side and a larger misfit than an earlier one of the filter."""
    free = solution.free
    assert solution.point.merit(free) <= solution.points[0].merit(free)
    if solution.first == 0:  # by the first iterations alone
        assert len(solution.points) <= MOST_REFINEMENTS + 2
        assert solution.converged
        return
    for k in range(solution.first, len(solution.points)):
        for j in range(solution.first, k):
            new, old = solution.points[k], solution.points[j]
            better = (
                new.merit(free) <= (1 - LEAST_GAIN) * old.merit(free)
                or new.misfit <= old.misfit - LEAST_GAIN
            )
            assert better or (k == len(solution.points) - 1 and solution.converged), (j, k)


@pytest.mark.parametrize(
    ("path", "options"),
    [
        ("viscoelastic", {"basis": "rectifier", "weighting": "noise"}),
        ("other direction", {"basis": "rectifier", "weighting": "flat"}),
        ("both directions", {"basis": "spline", "degree": 8, "weighting": "noise"}),
    ],
)
def test_a_hard_record_converges(path, options):
    """The iteration without second derivatives does not converge on these records."""
    record = make_incomplete_record(path)
    solution = solve(*set_up(record, reference="position", **options))
    assert solution.converged
    assert len(solution.points) > MOST_REFINEMENTS
    check_path(solution)
    estimate = identify(record, "riv", reference="position", **options)
    assert estimate.diagnostics["criterion"] < 0.01 < estimate.diagnostics["criterion_start"]
    assert estimate.diagnostics["intervals"] == "robust"


def test_a_delay_that_the_record_does_not_show_is_assumed():
    """The torque responds at once, which no reflex does: the delay goes to its lower limit."""
    trial = simulate(seed=1, closed_loop=False, delay=0.004, omega_n=60.0, duration=30.0)
    estimate = identify(trial, "riv", reference="position")
    assert estimate.reflex["delay"] == 0.04
    assert "delay" not in estimate.intervals
    assert any(
        "the record does not show it" in text for text in estimate.diagnostics["assumptions"]
    )


def test_a_third_pole_that_is_held_has_no_interval():
    """The other parameters are then those of second order."""
    trial = simulate(seed=2)
    third, second = (identify(trial, "riv", order=order) for order in (3, 2))
    assert third.diagnostics["converged"]
    assert "pole" not in third.intervals
    assert any("take order=2" in warning for warning in third.diagnostics["warnings"])
    for name, error in second.diagnostics["standard_errors"].items():
        values = [estimate.stiffness | estimate.reflex for estimate in (third, second)]
        assert abs(values[0][name] - values[1][name]) < 0.05 * error, name
