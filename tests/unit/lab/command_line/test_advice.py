"""Advice is tried on the file before it is given."""

import shlex

import numpy as np
import pandas as pd
import pytest

from ankleloop import simulate
from ankleloop_lab.command_line.check import find_advice
from ankleloop_lab.command_line.reading import map_file


@pytest.fixture(scope="module")
def columns():
    trial = simulate(seed=1, duration=20.0)
    names = ("time", "position", "torque", "reference")
    return {name: trial[name].values for name in names}


def write(folder, columns, **names):
    table = pd.DataFrame({names.get(name, name): values for name, values in columns.items()})
    table.to_csv(folder / "a.csv", index=False, float_format="%.7g")
    return folder / "a.csv"


@pytest.mark.parametrize(
    ("remedy", "advice"),
    [
        ({"torque_sign": -1}, {"torque_sign": -1}),
        ({"drift": 1}, {"torque_sign": -1}),  # no drift is there
        ({"position_unit": "deg"}, {}),  # which the name of the column contradicts
        ({"sampling_rate": None}, {"sampling_rate": None}),
        ({"overwrite": True}, {"overwrite": True}),
        ({}, {}),
    ],
)
def test_what_does_not_help_is_not_advised(tmp_path, columns, remedy, advice):
    turned = {**columns, "torque": -columns["torque"]}
    path = write(tmp_path, turned, position="angle_rad")
    assert find_advice(path, map_file(path), remedy) == advice


def test_what_is_asked_for_in_turn_is_advised_together(tmp_path, columns):
    """In degrees, which no name says, and with the other sign of the torque."""
    degrees = {name: np.degrees(columns[name]) for name in ("position", "reference")}
    path = write(tmp_path, {**columns, **degrees, "torque": -columns["torque"]})
    recording = map_file(path).model_copy(update={"position_unit": None})
    advice = find_advice(path, recording, {"position_unit": "deg"})
    assert advice == {"position_unit": "deg"}
    improved = recording.model_copy(update=advice)
    assert find_advice(path, improved, {"torque_sign": -1}) == {"torque_sign": -1}


SPOILED = {
    "turned": ({"torque": -1.0}, {}),
    "degrees": ({"position": 180 / np.pi, "reference": 180 / np.pi}, {}),
    "degrees, named": ({"position": 180 / np.pi}, {"position": "angle_deg"}),
    "torque in lbf·ft": ({"torque": 1 / 1.3558179}, {"torque": "torque_ftlb"}),
    "torque in V": ({"torque": 0.05}, {"torque": "torque_V"}),
    "a velocity": ({}, {"position": "theta_dot"}),
    "command in V": ({"reference": 10.0}, {"reference": "command_V", "position": "angle_rad"}),
    "turned twice": ({"torque": -1.0, "position": -1.0}, {}),
    "exchanged": ({}, {"position": "torque", "torque": "position"}),
}


@pytest.mark.parametrize("name", SPOILED)
def test_advice_ends_at_the_right_verdict_or_a_refusal(tmp_path, run, columns, name):
    """Each command is another one, and what it reads in the end has K and I of the joint, or is refused."""
    factors, names = SPOILED[name]
    spoiled = {key: factors.get(key, 1.0) * values for key, values in columns.items()}
    path = write(tmp_path, spoiled, **names)
    words = ["check", str(path)]
    commands = []
    while words not in commands:
        commands.append(words)
        result = run(*words)
        assert result.status in (0, 1, 2)
        steps = [
            line for line in result.err.splitlines() if line.startswith("next: ankleloop check")
        ]
        if not steps or "NUMBER" in steps[0] or "NAME" in steps[0]:
            break
        words = shlex.split(steps[0].removeprefix("next: ankleloop "))
    else:
        pytest.fail(f"the advice goes round: {commands}")
    assert len(commands) <= 3
    if result.status == 0:
        text = " ".join(result.out.split())
        stiffness = float(
            text.partition("second-order model without reflex has K = ")[2].split()[0]
        )
        assert stiffness == pytest.approx(233, rel=0.1)  # of the record as it was made
