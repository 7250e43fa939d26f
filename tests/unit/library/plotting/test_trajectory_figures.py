"""Figures of trajectories: what is not identified is blank, and the numbers that are drawn stand in a table."""

from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.patches import Rectangle

from ankleloop.joint.time_varying_course import trajectory_dataset
from ankleloop.plotting.estimates import trajectories_figure

PLACES = np.linspace(0.0, 1.0, 101)


def make_estimate(dimension="phase", blank=slice(0, 0)):
    values = 100.0 + 50.0 * np.sin(2 * np.pi * PLACES)
    values[blank] = np.nan
    curves = dict.fromkeys("KBG", values)
    curves |= {f"{name}_low": values - 5.0 for name in "KBG"}
    curves |= {f"{name}_high": values + 5.0 for name in "KBG"}
    excitation = np.where(np.isnan(values), 0.001, 1.0)
    return SimpleNamespace(
        method="riv-tv",
        trajectories=trajectory_dataset(dimension, PLACES, curves),
        diagnostics={"excitation": dict.fromkeys("KBG", excitation)},
    )


def grey_fields(axis):
    return [
        p
        for p in axis.patches
        if isinstance(p, Rectangle) and np.allclose(p.get_facecolor()[:3], 0xDD / 0xFF)
    ]


def test_what_is_not_identified_is_blank_and_grey():
    figure = trajectories_figure({"riv-tv": make_estimate(blank=slice(20, 41))})
    upper, lower = figure.axes[0], figure.axes[3]
    for axis in (upper, lower):
        fields = grey_fields(axis)
        assert fields[0].get_x() == pytest.approx(0.195)
        assert fields[-1].get_x() + fields[-1].get_width() == pytest.approx(0.405)
    line = next(line for line in upper.get_lines() if line.get_label() == "riv-tv")
    assert np.isnan(line.get_ydata()[20:41]).all()
    assert np.isfinite(line.get_ydata()[:20]).all()


def test_the_table_has_trajectories_bands_excitation_and_truth():
    truths = make_estimate().trajectories
    data = trajectories_figure({"riv-tv": make_estimate(blank=slice(0, 10))}, truths).data
    part = data.query("quantity == 'G' and series == 'riv-tv'")
    assert part["unit"].unique().tolist() == ["N·m·s/rad"]
    np.testing.assert_allclose((part["high"] - part["low"])[10:], 10.0)
    assert part["value"][:10].isna().all()
    np.testing.assert_allclose(
        data.query("quantity == 'G' and series == 'true value'")["value"], truths["G"]
    )
    excitation = data[data["quantity"] == "excitation"]
    np.testing.assert_allclose(excitation["value"][:10], 0.001)


def test_trajectories_over_different_things_are_refused():
    with pytest.raises(ValueError, match="functions of one thing, got phase, time"):
        trajectories_figure({"a": make_estimate(), "b": make_estimate("time")})
