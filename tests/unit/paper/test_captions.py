import pytest

from ankleloop.paper.captions import (
    describe_settings,
    format_truths,
    most_compliant_point,
    shared_truths,
    single_setting,
    typical_point,
)
from ankleloop.simulation.settings import SimulationSettings


def test_description_of_the_settings():
    settings = SimulationSettings.defaults()
    text = describe_settings(settings)
    for phrase in (
        "trials of 50 s",
        "reflex gain 13",
        "10 dB",
        "5 % of the clean net torque",
        "closed loop",
        "250 N·m/rad",
    ):
        assert phrase in text
    other = describe_settings({**settings, "snr_db": None, "voluntary": 0.0, "closed_loop": False})
    for phrase in ("no measurement noise", "no voluntary torque", "open loop"):
        assert phrase in other


def test_varied_settings_are_left_out():
    text = describe_settings(SimulationSettings.defaults(), ["reflex_gain", "load_stiffness"])
    assert "reflex gain" not in text
    assert "load" not in text
    assert "actuator" in text


def test_points_are_chosen_by_their_settings_in_any_order():
    default = SimulationSettings.defaults()
    points = {
        "soft": {**default, "load_stiffness": 25.0, "voluntary": 0.5},
        "printed": {**default, "reflex_gain": 2.0},
        "assumed": default,
    }
    varied = ["load_stiffness", "voluntary", "reflex_gain"]
    for names in (list(points), list(points)[::-1]):
        reordered = {name: points[name] for name in names}
        assert typical_point(reordered, varied) == "assumed"
        assert most_compliant_point(reordered) == "soft"
    del points["assumed"]
    assert typical_point(points, varied) == "printed"  # it has more of the defaults


def test_truths_that_differ_between_points_have_no_line():
    points = {"a": SimulationSettings.defaults(), "b": {**SimulationSettings.defaults(), "stiffness": 100.0}}
    assert shared_truths(points, ["K", "B"]) == {"K": None, "B": 0.8}
    assert format_truths(points, ["K", "B"]) == "K = 150 or 100 N·m/rad, B = 0.8 N·m·s/rad"


def test_a_figure_over_one_setting_refuses_others():
    assert single_setting(["reflex_gain"]) == "reflex_gain"
    for varied in ([], ["reflex_gain", "voluntary"]):
        with pytest.raises(ValueError, match=r"one setting, got (none|reflex_gain, voluntary): use the notebook"):
            single_setting(varied)
