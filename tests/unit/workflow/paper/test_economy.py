"""Economy: the options of the study count, ratios are those of the same trials, and every mean has its interval."""

import pytest

from ankleloop import DataError, simulate
from ankleloop_workflow.paper import economy
from ankleloop_workflow.paper.economy import measure_economy


@pytest.fixture(scope="module")
def trials():
    return [simulate(seed=seed, duration=10.0) for seed in range(3)]


def test_columns_follow_the_options(trials):
    options = {
        "pr-moesp": {"block_rows": 10, "degree": 3},
        "eiv-moesp": {"block_rows": 10, "degree": 3},
    }
    values = measure_economy(trials[:1], options).set_index("quantity")["value"]
    assert values["block_rows"] == values["pr-moesp_instrument_rows"] == 10
    assert values["eiv-moesp_instrument_rows"] == (3 + 3 + 1) * 10


def test_ratios_are_paired(trials, monkeypatch):
    """Times are those of a clock that runs differently in each trial: ratios of the same trial do not change."""
    speed = iter([1.0, 5.0, 25.0])

    def time_runs(runs):
        second = next(speed)
        return dict(zip(runs, (second, 2.0 * second), strict=True))

    monkeypatch.setattr(economy, "_time_runs", time_runs)
    table = measure_economy(trials, {}).set_index("quantity")
    ratio = table.loc["milliseconds_ratio"]
    assert ratio[["value", "low", "high"]].tolist() == pytest.approx([2.0, 2.0, 2.0])
    assert table.loc["pr-moesp_milliseconds", "value"] == pytest.approx(1e3 * 31 / 3)


def test_a_trial_that_a_method_cannot_identify_is_left_out(trials):
    short = trials[0].isel(time=slice(0, 600))
    table = measure_economy([short, *trials[:2]], {}).set_index("quantity")
    assert table.loc["milliseconds_ratio", "n"] == 2
    for none in ([short], []):
        with pytest.raises(DataError, match="there is no trial that both methods identify"):
            measure_economy(none, {})
