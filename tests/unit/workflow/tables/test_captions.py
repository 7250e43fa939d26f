from ankleloop.simulation.settings import SimulationSettings
from ankleloop_workflow.tables.captions import (
    describe_values,
    format_truths,
    shared_truths,
    typical_point,
)


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
    points = {
        "a": SimulationSettings.defaults(),
        "b": {**SimulationSettings.defaults(), "stiffness": 100.0},
    }
    assert shared_truths(points, ["K", "B"]) == {"K": None, "B": 0.8}
    assert format_truths(points, ["K", "B"]) == "K = 150 or 100 N·m/rad, B = 0.8 N·m·s/rad"


def test_values_of_a_point_are_said_in_words():
    values = {
        "point.load_stiffness": 50.0,
        "point.perturbation": "pulses",
        "point.closed_loop": False,
        "point.pr-moesp.block_rows": 20,
        "point.snr_db": None,
    }
    assert describe_values(values) == (
        "stiffness of the load 50 N·m/rad, decorrelating pulses, open loop, pr-moesp.block rows 20, "
        "signal-to-noise ratio infinite"
    )
