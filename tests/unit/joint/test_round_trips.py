"""What is read from a file is what was written: for every container and any values; damaged files are refused."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from value_comparison import assert_same_estimate

from ankleloop import identify, load_estimate, save_estimate, simulate
from ankleloop.joint.estimate import Estimate
from ankleloop.joint.estimate_files import EstimateTable, load_estimates
from ankleloop.joint.regressors import TORQUES, torque_dataset

EXAMPLES = settings(max_examples=15, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])

numbers = st.floats(width=64)  # also nan, infinities, -0.0 and subnormal numbers
finite = st.floats(allow_nan=False, allow_infinity=False)
names = st.from_regex(r"[a-z][a-z0-9_]{0,12}", fullmatch=True)
# A text of a MATLAB file has no byte 0, and an empty one is an empty array.
texts = st.text(st.characters(codec="utf-8", exclude_characters="\0", max_codepoint=0xD7FF), max_size=20)


def arrays(elements=numbers, **options):
    return hnp.arrays(float, hnp.array_shapes(max_dims=2, min_side=1, max_side=4), elements=elements, **options)


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
