"""An apparatus that is subtracted: the limb that is left, and how uncertain it is."""

from dataclasses import replace

import numpy as np
import pytest

from ankleloop import (
    DataError,
    block_bootstrap,
    compare,
    evaluate,
    identify,
    identify_each,
    load_estimate,
    load_trial,
    plan_duration,
    read_trial,
    save_estimate,
    save_trial,
    simulate,
    subtract,
)
from ankleloop.signals.decimation import differentiate

PLATE = {"K": 4.0, "B": 0.1, "I": 0.005, "friction": 0.0}
EMPTY = {"stiffness": 0.0, "viscosity": 0.1, "inertia": 0.005, "reflex_gain": 0.0, "voluntary": 0.0}
FRICTION = 0.6


@pytest.fixture(scope="module")
def empty():
    """A device with friction; a strong wander of its command keeps it moving."""
    rng = np.random.default_rng(1)
    command = 0.04 * np.repeat(rng.integers(0, 2, 300) - 0.5, 100)
    command += 0.1 * np.sin(2 * np.pi * 0.6 * np.arange(command.size) / 1000.0)
    trial = simulate(seed=1, command=command, duration=30.0, **EMPTY)
    return rub(trial).assign_attrs(source="empty.mat")


@pytest.fixture(scope="module")
def apparatus(empty):
    return identify(empty, "apparatus")


@pytest.fixture(scope="module")
def exact(apparatus):
    """An apparatus without friction, whose numbers are round."""
    known = apparatus.covariance.loc[["B", "I"], ["B", "I"]].to_dict()
    diagnostics = {**apparatus.diagnostics, "covariance": known}
    return replace(apparatus, stiffness={**PLATE, "offset": 0.0}, diagnostics=diagnostics)


@pytest.fixture(scope="module")
def trial():
    return simulate(seed=2, duration=30.0, inertia=0.02, viscosity=0.9)


def rub(trial, friction=FRICTION):
    velocity = differentiate(trial["position"].values, 1000.0)
    return trial.assign(torque=trial["torque"] + friction * np.sign(velocity))


def test_linear_parameters_are_those_of_the_whole_less_those_of_the_apparatus(trial, exact):
    whole = identify(trial)
    limb = identify(subtract(trial, exact))
    for name in ("K", "B", "I"):
        assert limb[name] == pytest.approx(whole[name] - PLATE[name], rel=1e-4), name
    for name in ("G", "omega_n", "zeta", "delay"):
        assert limb[name] == pytest.approx(whole[name], rel=1e-3), name
    variances = (limb.covariance - whole.covariance).loc[["B", "I"], ["B", "I"]]
    expected = exact.covariance.loc[["B", "I"], ["B", "I"]]
    np.testing.assert_allclose(variances, expected, rtol=0.05, atol=1e-9)


def test_friction_is_subtracted_and_its_warning_goes(trial, apparatus):
    rubbed = rub(trial)
    before = identify(rubbed)
    assert "ankleloop identify EMPTY --method apparatus" in " ".join(before.warnings)
    limb = identify(subtract(rubbed, apparatus))
    assert not limb.warnings
    truth = {"K": 150.0, "B": 0.8, "I": 0.015, "G": 13.0}
    for name, value in truth.items():
        low, high = limb.intervals[name]
        assert low < value < high, name
    assert abs(before["B"] / 0.9 - 1.0) > 0.2


def test_samples_stay_and_torques_are_those_of_the_limb(trial, apparatus):
    rubbed = rub(trial)
    carried = subtract(rubbed, apparatus)
    assert carried["torque"].identical(rubbed["torque"])
    limb = identify(carried)
    assert limb.vaf_net > identify(rubbed).vaf_net
    shown = evaluate(carried, limb, against="measured").set_index("torque")["vaf"]["net"]
    assert shown == pytest.approx(limb.vaf_net)
    assert "less the apparatus of empty.mat: I 0.00" in repr(limb)
    assert "less the apparatus of empty.mat" in limb.methods_text()


def test_files_hold_the_apparatus(trial, apparatus, tmp_path):
    carried = subtract(trial, apparatus)
    save_trial(carried, tmp_path / "trial.nc")
    save_estimate(apparatus, tmp_path / "empty.nc")
    trial.to_dataframe()[["position", "torque", "reference"]].to_csv(tmp_path / "trial.csv")
    read = read_trial(tmp_path / "trial.csv", apparatus=str(tmp_path / "empty.nc"))
    limb = identify(carried)
    assert identify(load_trial(tmp_path / "trial.nc"))["I"] == limb["I"]
    assert identify(read)["I"] == pytest.approx(limb["I"])
    save_estimate(limb, tmp_path / "limb.nc")
    assert load_estimate(tmp_path / "limb.nc").apparatus == limb.apparatus


def test_the_share_of_the_apparatus_does_not_shrink_with_trials(apparatus):
    trials = [
        subtract(simulate(seed=seed, duration=15.0, inertia=0.02), apparatus) for seed in range(3)
    ]
    one = identify(trials[0]).diagnostics["apparatus"]["standard_errors"]
    merged = identify(trials)
    three = merged.diagnostics["apparatus"]["standard_errors"]
    assert three["I"] == pytest.approx(one["I"], rel=0.05)
    assert three["I"] == pytest.approx(apparatus.standard_errors["I"], rel=0.01)
    assert merged.standard_errors["I"] > three["I"]


def test_a_joint_that_changes_is_less_the_apparatus_too(exact):
    trial = simulate(
        seed=3, duration=60.0, variation="cycle", stiffness_variation=0.3, inertia=0.02
    )
    options = {"cycle_onsets": "phase"}
    whole = identify(trial, "riv-tv", **options)
    limb = identify(subtract(trial, exact), "riv-tv", **options)
    for name in ("K", "I"):
        assert limb[name] == pytest.approx(whole[name] - PLATE[name], rel=0.002), name
    shared = limb.diagnostics["apparatus"]["standard_errors"]["I"]
    assert shared == pytest.approx(exact.standard_errors["I"], rel=0.05)
    assert shared < whole.standard_errors["I"]
    assert limb.standard_errors["I"] > shared
    difference = whole.trajectories["K"] - limb.trajectories["K"]
    np.testing.assert_allclose(difference, 4.0, atol=0.5)


def test_a_mean_has_its_error_once_and_a_difference_has_none(exact):
    uncertain = replace(exact, diagnostics={**exact.diagnostics, "covariance": {"K": {"K": 100.0}}})
    trials = [
        subtract(
            simulate(seed=10 * subject + k, duration=15.0, stiffness=level), uncertain
        ).assign_attrs(subject=f"S{subject}", condition=condition)
        for subject in range(3)
        for k, (condition, level) in enumerate({"rest": 100.0, "active": 150.0}.items())
    ]
    table = identify_each(trials, "riv")
    assert table["K_apparatus"].to_numpy() == pytest.approx(10.0, rel=0.02)
    with_error = compare(table).set_index(["parameter", "kind"]).loc["K"]
    alone = compare(table.drop(columns="K_apparatus")).set_index(["parameter", "kind"]).loc["K"]
    margins, margins_alone = (
        (rows["high"] - rows["value"]).to_numpy() for rows in (with_error, alone)
    )
    means, difference = slice(0, 2), slice(2, 3)
    np.testing.assert_allclose(margins[means], np.hypot(margins_alone[means], 19.6), rtol=0.02)
    np.testing.assert_allclose(margins[difference], margins_alone[difference], rtol=1e-3)


def test_a_plan_is_of_the_part_that_time_narrows(trial, exact):
    share = {"covariance": {"I": {"I": 1e-8}}}
    limb = identify(subtract(trial, replace(exact, diagnostics={**exact.diagnostics, **share})))
    whole = identify(trial)
    same_width = {"I": 0.05 * limb["I"] / whole["I"]}
    assert plan_duration(limb, {"I": 0.05}).seconds > plan_duration(whole, same_width).seconds
    with pytest.raises(DataError, match="I within 1 % cannot be had however long"):
        plan_duration(limb, {"I": 0.01})


def test_what_cannot_be_subtracted_is_refused(trial, apparatus, exact):
    carried = subtract(trial, apparatus)
    with pytest.raises(DataError, match=r"and pr-moesp does not know .* take riv or riv-tv"):
        identify(carried, "pr-moesp")
    with pytest.raises(DataError, match="subtracted of this trial already"):
        subtract(carried, apparatus)
    with pytest.raises(DataError, match="less different apparatuses"):
        identify([carried, subtract(simulate(seed=3, duration=30.0), exact)])
    with pytest.raises(DataError, match="by riv: identify the empty device"):
        subtract(trial, identify(trial))
    with pytest.raises(DataError, match="has not written: give it another name"):
        identify(trial.assign_attrs(apparatus="footplate"))
    with pytest.raises(DataError, match="how uncertain the apparatus is"):
        block_bootstrap(carried, "riv", repetitions=2)
    with pytest.raises(TypeError, match="apparatus must be an Estimate"):
        subtract(trial, "empty.nc")


def test_an_apparatus_that_warns_is_not_subtracted(trial):
    resting = rub(simulate(seed=1, duration=30.0, **EMPTY), friction=0.3)
    estimate = identify(resting, "apparatus")
    assert "the device rests for" in estimate.warnings[0]
    with pytest.raises(DataError, match="the apparatus cannot be trusted: the device rests"):
        subtract(trial, estimate)
