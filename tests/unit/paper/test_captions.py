import pytest

from ankleloop.paper.captions import (
    describe_settings,
    format_truths,
    shared_truths,
    single_setting,
    typical_point,
)
from ankleloop.simulation.settings import SimulationSettings


def test_description_of_the_settings():
    settings = SimulationSettings.defaults()
    text = describe_settings(settings)
    phrases = ("duration 50 s", "reflex gain 13", "ratio 10 dB", "voluntary torque 0.05", "closed loop", "250 N·m/rad")
    assert [phrase for phrase in phrases if phrase not in text] == []
    other = describe_settings({**settings, "snr_db": None, "closed_loop": False}, ["reflex_gain", "load_stiffness"])
    assert "signal-to-noise ratio infinite" in other
    assert "open loop" in other
    assert "reflex gain" not in other
    assert "stiffness of the load" not in other


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
