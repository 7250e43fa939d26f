"""Runs that end by SIGKILL or meet each other, and what the next run makes of what they leave."""

import random
import shutil
import time

from workflow_runs import CHUNKS, list_differences, read_results

KILLS = 10
SEED = 2008


def test_results_after_a_kill_are_those_of_an_undisturbed_run(start, finish, undisturbed, tmp_path):
    """Every other kill takes the jobs along; otherwise they go on as orphans while the next run begins."""
    expected, duration = undisturbed
    assert {"tables/study.csv", "reports/study.html", f"scores/study/{CHUNKS - 1}.parquet"} <= set(
        expected
    )
    generator = random.Random(SEED)
    during = 0
    for number in range(KILLS):
        folder = tmp_path / "work"
        folder.mkdir()
        moment = generator.uniform(0.0, duration)
        run = start(folder)
        time.sleep(moment)
        during += run.process.poll() is None
        run.kill(jobs=number % 2 == 0)
        results = finish(folder)
        different = list_differences(expected, results)
        assert not [name for name in results if name.endswith(".part")]
        assert not different, f"kill {number} after {moment:.1f} s: {different}"
        shutil.rmtree(folder)
    assert during >= KILLS / 2


def test_a_second_run_in_the_same_folder_refuses_and_the_first_finishes(
    start, undisturbed, tmp_path
):
    expected, _ = undisturbed
    first = start(tmp_path)
    first.wait_for(lambda: list((tmp_path / "results").rglob("*.nc")))
    second = start(tmp_path)
    assert second.wait() != 0
    assert "locked" in second.text
    assert "--unlock" in second.text
    assert first.process.poll() is None  # the second came while the first ran
    assert first.wait() == 0, first.text
    assert not list_differences(expected, read_results(tmp_path))
