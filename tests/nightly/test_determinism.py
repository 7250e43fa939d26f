"""The same results on any number of cores, in any chunks, and to a stated tolerance on any kind of processor."""

import copy
import runpy
from pathlib import Path

import pytest
import yaml
from pyarrow import parquet
from workflow_runs import STUDY

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
CHUNKS = {
    "one core": ({"trials_per_chunk": 2}, "1"),
    "two cores": ({"trials_per_chunk": 2}, "2"),
    "a chunk for each trial": ({"trials_per_chunk": 1}, "2"),
    "a chunk for each point": ({"trials_per_chunk": 200}, "2"),
}


@pytest.fixture(scope="module")
def tables(repository, snakemake, tmp_path_factory):
    """Tables of the study for each number of cores and each division into chunks, which Parquet states by its hash."""

    def make(chunks, cores):
        folder = tmp_path_factory.mktemp("run")
        config = copy.deepcopy(STUDY)
        config["studies"]["study"] |= chunks
        path = folder / "config.yaml"
        path.write_text(yaml.safe_dump(config), encoding="utf-8")
        snakefile = str(repository / "Snakefile")
        snakemake(
            repository,
            "--snakefile",
            snakefile,
            "--configfile",
            str(path),
            "--cores",
            cores,
            folder=folder,
        )
        files = (folder / "results" / "tables").iterdir()
        return {
            f.name: parquet.read_table(f) if f.suffix == ".parquet" else f.read_bytes()
            for f in files
        }

    return {name: make(*arguments) for name, arguments in CHUNKS.items()}


@pytest.mark.parametrize("name", list(CHUNKS)[1:])
def test_tables_depend_neither_on_cores_nor_on_chunks(tables, name):
    expected, results = tables["one core"], tables[name]
    assert {"study.csv", "study.md"} <= set(expected)
    assert set(results) == set(expected)
    assert [file for file in expected if results[file] != expected[file]] == []


def test_kinds_of_processor_give_the_same_results_to_the_stated_tolerance():
    processors = runpy.run_path(str(BENCHMARKS / "processors.py"))
    results = processors["run_kinds"]()
    if len(results) < 2:
        pytest.skip("OpenBLAS has kernels for no other kind of processor here.")
    differences = processors["compare"](results)
    assert differences.where(differences > processors["LIMIT"]).stack().dropna().to_dict() == {}
    assert (differences > 0).any(axis=None)  # the kernels do differ
