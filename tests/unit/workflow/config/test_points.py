"""Points: names, ranges, designs, lists; conditions; what is refused."""

import numpy as np
import pandas as pd
import pytest

from ankleloop.methods.registry import METHODS
from ankleloop.simulation.settings import SimulationSettings
from ankleloop_lab.checking import ConfigError
from ankleloop_workflow.config.points import list_points
from ankleloop_workflow.config.settings import MethodSettings


def methods(**named):
    """Methods of a study: by name the method, or the method and its options."""
    settings = {}
    for name, value in named.items():
        method, options = value if isinstance(value, tuple) else (value, {})
        settings[name] = MethodSettings(method=method, options=METHODS[method].options(**options))
    return settings


TWO = methods(pr="pr-moesp", cascade="parallel-cascade")


def read(points, named=TWO, **shared):
    return list_points("mine", points, SimulationSettings(**shared), named)[0]


def test_a_load_is_three_settings_and_a_point_of_a_list_may_have_several_values():
    """Conditions have the names of the settings, by which their seeds are keyed."""
    light, heavy = ([0.1, 10.0, 100.0], [1.1, 7.1, 250.0])
    points = read({"load": [light, heavy], "voluntary": [0.05, 0.3]})
    assert [point.condition for point in points] == [
        f"load_inertia={load[0]},load_stiffness={load[2]},load_viscosity={load[1]},voluntary={level}"
        for load in (light, heavy)
        for level in (0.05, 0.3)
    ]
    listed = read([{"load": light, "voluntary": [0.05, 0.3]}, {"load": heavy, "voluntary": 0.3}])
    assert [point.name for point in listed] == [points[k].name for k in (0, 1, 3)]


def test_an_option_of_several_numbers_varies():
    named = methods(tv="riv-tv")
    points = read({"knots": [[12, 8, 12], [24, 16, 24]]}, named)
    assert [point.name for point in points] == ["knots=12, 8, 12", "knots=24, 16, 24"]
    options = METHODS["riv-tv"].options(**points[1].options["tv"])
    assert options.knots == (24, 16, 24)
    with pytest.raises(ConfigError, match="knots"):
        read({"knots": [[12, 8]]}, named)


def test_options_vary_beside_settings_and_share_trials():
    points = read({"reflex_gain": [8, 12], "block_rows": [12, 18]})
    assert [point.name for point in points] == [
        f"block_rows={rows},reflex_gain={gain}" for gain in (8.0, 12.0) for rows in (12, 18)
    ]
    assert [point.condition for point in points] == ["reflex_gain=8.0"] * 2 + [
        "reflex_gain=12.0"
    ] * 2
    assert points[1].options == {"pr": {"block_rows": 18}}
    assert points[1].values == {"reflex_gain": 8.0, "block_rows": 18}


def test_a_name_is_that_of_a_setting_or_of_an_option_of_every_method_that_has_it():
    """The names of conditions are the keys of seeds."""
    three = methods(a="pr-moesp", b="eiv-moesp", c="parallel-cascade")
    for name, value, options in (
        ("rank_tolerance", 1e-5, {"a", "b"}),
        ("order", 3, {"a", "b"}),
        ("b.order", 3, {"b"}),
        ("delay", 0.03, set()),
        ("a.delay", 0.03, {"a"}),
    ):
        (point,) = read({name: [value]}, three)
        assert point.options == {method: {name.rpartition(".")[2]: value} for method in options}
        assert point.name == f"{name}={value}"
        assert point.condition == ("only" if options else point.name)


def test_points_that_leave_a_parameter_out_have_the_shared_value():
    points = read([{"reflex_gain": 8}, {"stiffness": 100}, {"pr.block_rows": 12}], stiffness=120.0)
    assert points[0].values == {"reflex_gain": 8.0, "stiffness": 120.0, "pr.block_rows": 15}
    assert points[1].values == {"reflex_gain": 13.0, "stiffness": 100.0, "pr.block_rows": 15}
    assert points[0].name == "reflex_gain=8.0"
    assert points[0].options == {}


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ({"start": 0, "stop": 0.3, "count": 4}, [0.0, 0.1, 0.2, 0.3]),
        ({"start": -0.1, "stop": 0.1, "count": 3}, [-0.1, 0.0, 0.1]),
        (
            {"start": 0.01, "stop": 100, "count": 5, "scale": "logarithmic"},
            [0.01, 0.1, 1.0, 10.0, 100.0],
        ),
    ],
)
def test_ranges(values, expected):
    name = "snr_db" if expected[0] < 0 else "reflex_threshold"
    assert [point.values[name] for point in read({name: values})] == expected


DESIGN = {
    "design": "latin-hypercube",
    "count": 64,
    "seed": 1,
    "parameters": {
        "reflex_gain": {"start": 2, "stop": 30},
        "stiffness": {"start": 10, "stop": 1000, "scale": "logarithmic"},
        "block_rows": {"start": 10, "stop": 13},
        "perturbation": ["prbs", "pulses"],
    },
}


def test_designs_fill_every_margin_evenly():
    """Of 64 points each of 64 equal parts of an interval holds one, and each value of a list an equal share."""
    table = pd.DataFrame([point.values for point in read(DESIGN)])
    assert sorted((table["reflex_gain"] - 2) // (28 / 64)) == list(range(64))
    assert sorted(np.log10(table["stiffness"] / 10) // (2 / 64)) == list(range(64))
    assert set(table["block_rows"].value_counts()) == {16}
    assert set(table["perturbation"].value_counts()) == {32}


def test_a_list_has_an_entry_for_each_point():
    points = read(
        [
            {"reflex_gain": 8, "snr_db": 10, "closed_loop": True, "pr.basis": "rectifier"},
            {"reflex_gain": 12.5, "snr_db": None, "closed_loop": False, "pr.basis": None},
        ]
    )
    expected = [
        {"reflex_gain": 8.0, "snr_db": 10.0, "closed_loop": True, "pr.basis": "rectifier"},
        {"reflex_gain": 12.5, "snr_db": None, "closed_loop": False, "pr.basis": None},
    ]
    assert [point.values for point in points] == expected


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (
            {"pr.order": [2], "order": [3]},
            r"pr\.order and order are the same option of the method pr",
        ),
        ({"prr.order": [2]}, r"'prr\.order' is not a setting .*\(did you mean 'pr\.order'\?\)"),
        (
            {"reflex_gain": {"start": 2, "stop": 1, "count": 3}},
            r"stop must be at least start \(2\), got 1",
        ),
        (
            [{"reflex_gain": 8}, {"reflex_gain": 8, "block_rows": 15}],
            "block_rows=15,reflex_gain=8.0 is listed twice",
        ),
        ({"load": [0.1, 10.0]}, r"load: must be \[inertia, viscosity, stiffness\], or a list of"),
        (
            {**DESIGN, "parameters": {"order": {"start": 1.2, "stop": 1.8}}},
            r"points → parameters → order: there is no whole number from 1\.2 to 1\.8",
        ),
    ],
)
def test_refusals(points, message):
    with pytest.raises(ConfigError, match=message):
        read(points)
