"""Times of jobs are read from benchmark files as Snakemake writes them."""

import os

import pytest

from ankleloop.studies.run_times import measure_span, read_run_times, summarise_run_times

HEADER = "s\th:m:s\tmax_rss\tmax_vms\tmax_uss\tmax_pss\tio_in\tio_out\tmean_load\tcpu_time\n"


def write(folder, name, seconds, processor, memory, end):
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    row = [seconds, "0:00:02", memory, "1", "1", "1", "1", "1", "1", processor]
    path.write_text(HEADER + "\t".join(map(str, row)) + "\n", encoding="utf-8")
    os.utime(path, (end, end))


@pytest.fixture
def logs(tmp_path):
    write(tmp_path, "identify/table1/0.tsv", 10.0, 9.0, 300.0, 1000.0)
    write(tmp_path, "identify/table1/1.tsv", 20.0, 18.0, 400.0, 1005.0)
    write(tmp_path, "report/table1.tsv", 5.0, 4.0, 200.0, 2000.0)
    write(tmp_path, "article.tsv", 3.0, "-", "-", 2003.0)  # too short for Snakemake to measure its memory
    (tmp_path / "identify/table1/0.log").write_text("text", encoding="utf-8")
    (tmp_path / "other.tsv").write_text("name\tvalue\na\t1\n", encoding="utf-8")
    return tmp_path


def test_jobs_have_their_rule_and_study(logs):
    times = read_run_times(logs)
    assert times[["rule", "study"]].values.tolist() == [
        ["article", ""],
        ["identify", "table1"],
        ["identify", "table1"],
        ["report", "table1"],
    ]
    assert times["seconds"].tolist() == [3.0, 10.0, 20.0, 5.0]


def test_sums_over_rules_and_studies(logs):
    times = read_run_times(logs)
    rules = summarise_run_times(times, "rule").set_index("rule")
    assert list(rules.index) == ["identify", "report", "article"]
    assert rules.loc["identify"].tolist() == [2, 30.0, 20.0, 27.0, 400.0]
    assert summarise_run_times(times, "study").set_index("study").loc["table1", "seconds"] == 35.0


def test_time_without_a_job_does_not_count(logs):
    first, last, duration = measure_span(read_run_times(logs))
    assert (first.timestamp(), last.timestamp()) == (985.0, 2003.0)
    assert duration == pytest.approx(20.0 + 5.0 + 3.0)


def test_no_files_are_no_jobs(tmp_path):
    times = read_run_times(tmp_path)
    assert times.empty
    assert measure_span(times) is None
    assert summarise_run_times(times, "rule").empty
