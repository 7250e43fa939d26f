"""Chunks of a target duration: stable where a study changes, parts of trial files, of a length that fits."""

import pytest

from ankleloop.studies import study as study_module
from ankleloop.studies.study import read_studies

METHODS = {"pr-moesp": {"method": "pr-moesp"}, "riv": {"method": "riv"}}
# Time for the simulation of a trial of 50 s, and for its identification by a method with 15 block rows [s].
TRIAL = 0.01


@pytest.fixture(autouse=True)
def known_costs(monkeypatch):
    """Costs that no measurement changes."""

    def identify(samples, methods, rate):
        rows = sum(method["options"].get("block_rows", 15) for method in methods)
        return TRIAL * samples / 50_000 * rows / 15

    monkeypatch.setattr(
        study_module, "simulation_seconds", lambda samples: TRIAL * samples / 50_000
    )
    monkeypatch.setattr(study_module, "identification_seconds", identify)


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
@pytest.mark.parametrize("minutes", [0.01, 0.1, 1.0, 100.0])
def test_every_trial_is_in_one_chunk(keep, minutes):
    study = sweep(keep=keep, job_minutes=minutes)
    expected = [(condition, number) for condition in study.conditions for number in range(100)]
    assert sorted(numbers(study.chunks)) == sorted(expected)
    assert sorted(numbers(study.trial_chunks)) == (sorted(expected) if keep == "everything" else [])


@pytest.mark.parametrize("minutes", [0.2, 1.0, 5.0])
def test_jobs_take_about_as_long_as_they_should(minutes):
    """Powers of two come within a factor of two of the duration, the start of the job aside."""
    study = sweep(keep="scores", job_minutes=minutes, points={"reflex_gain": list(range(1000))})
    lengths = [3 * TRIAL * sum(part.stop - part.first for part in chunk) for chunk in study.chunks]
    assert all(60 * minutes / 4 < length < 60 * minutes * 1.5 for length in lengths[:-1])


def test_a_chunk_of_identification_is_part_of_one_trial_file():
    study = sweep(
        job_minutes=0.2,
        methods=METHODS | {"wide": {"method": "pr-moesp", "options": {"block_rows": 60}}},
    )
    assert len(study.chunks) > len(study.trial_chunks) > 1
    for number, chunk in enumerate(study.chunks):
        stored = set(numbers([study.trial_chunks[study.trial_chunk_numbers[number]]]))
        assert set(numbers([chunk])) <= stored


def test_another_method_or_option_simulates_nothing_again():
    study = sweep()
    for other in (
        sweep(methods={"pr-moesp": {"method": "pr-moesp"}}),
        sweep(points={"reflex_gain": list(range(60)), "pr-moesp.block_rows": list(range(10, 30))}),
    ):
        files = range(len(study.trial_chunks))
        assert len(other.trial_chunks) == len(study.trial_chunks)
        assert all(
            other.simulation(other.trial_chunks[k]) == study.simulation(study.trial_chunks[k])
            for k in files
        )
    assert len(other.chunks) > len(study.chunks)


def jobs(study):
    """What the jobs of each chunk depend on."""
    return [
        (study.simulation(parts)["conditions"], study.hashes[chunk])
        for chunk, parts in enumerate(study.chunks)
    ]


@pytest.mark.parametrize("keep", ["everything", "scores"])
def test_an_edited_row_changes_its_chunk_alone(tmp_path, keep):
    rows = [f"{8 + 0.01 * k:.2f},{10 + k % 7}" for k in range(200)]

    def read(rows):
        (tmp_path / "sweep.csv").write_text("\n".join(["reflex_gain,block_rows", *rows]) + "\n")
        return jobs(sweep(points={"table": str(tmp_path / "sweep.csv")}, keep=keep, trials=50))

    before = read(rows)
    rows[77] = "20.0,15"
    after = read(rows)
    changed = [k for k, (old, new) in enumerate(zip(before, after, strict=True)) if old != new]
    assert len(before) > 5
    assert len(changed) == 1
    assert "reflex_gain=20.0" in after[changed[0]][0]
