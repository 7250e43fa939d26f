"""What is read from a file is what was written: for every container and any values; damaged files are refused."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from value_comparison import assert_same_estimate

from ankleloop import identify, load_estimate, load_trial, new_trial, save_estimate, save_trial, simulate
from ankleloop.joint.estimate import Estimate
from ankleloop.joint.estimate_files import EstimateTable, load_estimates
from ankleloop.joint.regressors import TORQUES, torque_dataset
from ankleloop.trials.group_files import read_groups, write_groups
from ankleloop.trials.trial_files import load_trials, save_trials

EXAMPLES = settings(max_examples=15, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])

numbers = st.floats(width=64)  # also nan, infinities, -0.0 and subnormal numbers
finite = st.floats(allow_nan=False, allow_infinity=False)
names = st.from_regex(r"[a-z][a-z0-9_]{0,12}", fullmatch=True)
# A text of a MATLAB file has no byte 0, and an empty one is an empty array.
texts = st.text(st.characters(codec="utf-8", exclude_characters="\0", max_codepoint=0xD7FF), max_size=20)


def bits(array):
    return np.asarray(array, dtype=float).tobytes()


def arrays(elements=numbers, **options):
    return hnp.arrays(float, hnp.array_shapes(max_dims=2, min_side=1, max_side=4), elements=elements, **options)


@st.composite
def groups(draw):
    """Groups of variables and attributes; names do not serve twice in a group."""
    contents = {}
    for group in draw(st.lists(names, max_size=2, unique=True)):
        values = draw(st.dictionaries(names, st.one_of(arrays(), numbers, texts), max_size=4))
        variables = {
            name: (tuple(f"{name}_{axis}" for axis in range(np.ndim(value))), value)
            for name, value in values.items()
            if not isinstance(value, str)
        }
        attributes = {name: value for name, value in values.items() if isinstance(value, str)}
        contents[group] = xr.Dataset(variables, attrs=attributes)
    return contents


@EXAMPLES
@given(contents=groups())
@pytest.mark.parametrize("suffix", [".nc", ".mat"])
def test_groups(tmp_path, suffix, contents):
    path = tmp_path / f"x{suffix}"
    write_groups({"": xr.Dataset(attrs={"kind": "k"})} | contents, path, "v", overwrite=True)
    read = read_groups(path, "v")
    assert read[""].text("kind") == "k"
    for group, data in contents.items():
        for name, variable in data.data_vars.items():
            assert bits(read[group].array(name, *variable.shape, finite=False)) == bits(variable.values)
        for name, text in data.attrs.items():
            assert read[group].text(name) == text


@st.composite
def trials_of(draw):
    """Trials of equal length, some of whose extra channels are constant."""
    size, count = draw(st.integers(8, 20)), draw(st.integers(1, 4))
    rate = draw(st.sampled_from([100.0, 333.3, 1000.0]))
    trials = []
    for number in range(count):
        torque = draw(hnp.arrays(float, size, elements=st.floats(-1e6, 1e6)))
        torque[:2] = 0.0, 1.0  # it is not constant
        extra = draw(st.one_of(st.just(np.zeros(size)), hnp.arrays(float, size, elements=finite)))
        position = 1e-3 * np.arange(size) / rate * draw(st.floats(0.5, 2.0))
        trials.append(new_trial(position, torque, rate, emg=extra, seed=number, note=draw(texts)))
    return trials


@EXAMPLES
@given(trials=trials_of())
def test_trials(tmp_path, trials):
    save_trials(trials, tmp_path / "x.nc", overwrite=True)
    loaded = list(load_trials(tmp_path / "x.nc"))
    assert len(loaded) == len(trials)
    for before, after in zip(trials, loaded, strict=True):
        assert after.attrs == before.attrs
        for name in before.variables:
            values = before[name].values
            # A constant channel is kept as one number, which is its first one: 0.0 equals -0.0.
            assert bits(after[name].values) == bits(values) or (after[name] == values[0]).all()
    save_trial(trials[0], tmp_path / "y.nc", overwrite=True)
    assert load_trial(tmp_path / "y.nc").identical(trials[0])


values_of_diagnostics = st.recursive(
    st.one_of(st.none(), st.booleans(), st.integers(-(2**53), 2**53), numbers, texts, arrays()),
    lambda children: st.one_of(st.lists(children, max_size=3), st.dictionaries(names, children, max_size=3)),
    max_leaves=6,
)


@st.composite
def estimates(draw, fitted):
    """Estimates with any numbers; the model is that of a fit, with other matrices."""
    size = draw(st.integers(2, 12))
    torques = {name: draw(hnp.arrays(float, size, elements=finite)) for name in TORQUES}
    model = fitted.predictor
    matrices = replace(model.matrices, D=draw(hnp.arrays(float, model.matrices.D.shape, elements=finite)))
    model = draw(st.sampled_from([replace(model, matrices=matrices), None]))
    parameters = {name: draw(numbers) for name in ("G", "omega_n", "zeta")}
    return Estimate(
        method="pr-moesp",
        torque=torque_dataset(0.35 + np.arange(size) / 100.0, 100.0, **torques),
        matrices=None if model is None else matrices,
        stiffness={name: draw(numbers) for name in ("K", "B", "I")},
        reflex={"delay": 0.04, **parameters},
        intervals=draw(st.dictionaries(st.sampled_from(["K", "G"]), st.tuples(numbers, numbers))),
        diagnostics=draw(st.dictionaries(names.filter(lambda name: name != "json"), values_of_diagnostics, max_size=3)),
        predictor=model,
    )


@pytest.fixture(scope="module")
def fitted():
    return identify(simulate(seed=1, duration=10.0), "pr-moesp")


@EXAMPLES
@given(data=st.data())
@pytest.mark.parametrize("suffix", [".nc", ".mat"])
def test_an_estimate(tmp_path, fitted, suffix, data):
    estimate = data.draw(estimates(fitted))
    save_estimate(estimate, tmp_path / f"x{suffix}", overwrite=True)
    assert_same_estimate(load_estimate(tmp_path / f"x{suffix}"), estimate)


@EXAMPLES
@given(data=st.data())
def test_estimates_of_a_chunk(tmp_path, fitted, data):
    path = tmp_path / "x.parquet"
    several = data.draw(st.lists(estimates(fitted), min_size=1, max_size=3))
    table = EstimateTable()
    for number, estimate in enumerate(several):
        table.add(estimate, point="a", name="x", number=number)
    table.add(several[0], point="a", name="y", number=0)
    table.write(path, overwrite=True)
    loaded = load_estimates([path], "a", "x")
    assert list(loaded) == list(range(len(several)))
    for number, saved in enumerate(several):
        assert_same_estimate(loaded[number], saved)
    assert load_estimates([path], "a", "z") == {}
