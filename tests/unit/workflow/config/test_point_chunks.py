"""Chunks of a number of trials: stable where a study changes, parts of trial files."""

import pytest

from ankleloop_workflow.config.study import MAX_SAMPLES, read_studies

METHODS = {"pr-moesp": {"method": "pr-moesp"}, "riv": {"method": "riv"}}


def sweep(**settings):
    study = {
        "kind": "simulation",
        "notebook": None,
        "trials": 100,
        "seed": 1,
        "points": {"reflex_gain": list(range(60))},
        "methods": METHODS,
    }
    return read_studies({"studies": {"s": study | settings}})[1]["s"]


def numbers(chunks):
    """Condition and number of every trial."""
    return [
        (part.condition, number)
        for chunk in chunks
        for part in chunk
        for number in range(part.first, part.stop)
    ]


@pytest.mark.parametrize("keep", ["everything", "estimates", "scores"])
@pytest.mark.parametrize("most", [1, 30, 200, 450, 100_000])
def test_every_trial_is_in_one_chunk_of_the_size_that_is_asked_for(keep, most):
    study = sweep(keep=keep, trials_per_chunk=most)
    expected = [(condition, number) for condition in study.conditions for number in range(100)]
    assert sorted(numbers(study.chunks)) == sorted(expected)
    assert sorted(numbers(study.trial_files)) == (sorted(expected) if keep == "everything" else [])
    sizes = [len(numbers([chunk])) for chunk in study.chunks]
    if keep == "scores" and most >= 100:  # whole points, and as many as there is room for
        assert set(sizes[:-1]) <= {100 * (most // 100)}
    assert max(sizes) <= most


def test_a_trial_file_stays_below_its_limit_of_samples():
    study = sweep(simulation={"duration": 1000.0}, trials_per_chunk=1000)
    assert len(study.trial_files) > 60
    assert max(len(numbers([file])) for file in study.trial_files) * 1_000_000 <= MAX_SAMPLES


def test_a_chunk_of_identification_is_part_of_one_trial_file():
    study = sweep(points={"reflex_gain": [1.0, 2.0, 3.0, 4.0], "block_rows": [10, 12, 15, 20]})
    assert len(study.chunks) > len(study.trial_files) > 1
    for number, chunk in enumerate(study.chunks):
        stored = set(numbers([study.trial_files[study.file_numbers[number]]]))
        assert set(numbers([chunk])) <= stored


def test_another_method_or_option_simulates_nothing_again():
    study = sweep()
    for other in (
        sweep(methods={"pr-moesp": {"method": "pr-moesp"}}),
        sweep(points={"reflex_gain": list(range(60)), "pr-moesp.block_rows": list(range(10, 30))}),
    ):
        files = range(len(study.trial_files))
        assert len(other.trial_files) == len(study.trial_files)
        assert all(
            other.simulation(other.trial_files[k]) == study.simulation(study.trial_files[k])
            for k in files
        )
    assert len(other.chunks) > len(study.chunks)


def jobs(study):
    """What the jobs of each chunk depend on."""
    return [
        (study.simulation(parts)["conditions"], study.identification(chunk))
        for chunk, parts in enumerate(study.chunks)
    ]


@pytest.mark.parametrize("keep", ["everything", "scores"])
def test_an_edited_point_changes_its_chunk_alone(keep):
    points = [{"reflex_gain": 8 + 0.01 * k, "block_rows": 10 + k % 7} for k in range(200)]
    before = jobs(sweep(points=points, keep=keep, trials=50))
    points[77] = {"reflex_gain": 20.0, "block_rows": 15}
    after = jobs(sweep(points=points, keep=keep, trials=50))
    changed = [k for k, (old, new) in enumerate(zip(before, after, strict=True)) if old != new]
    assert len(before) > 5
    assert len(changed) == 1
    assert "reflex_gain=20.0" in after[changed[0]][0]
