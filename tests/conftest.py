import shutil
import subprocess
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml
from workflow_runs import PROGRAM, STUDY, TINY, Run, environment

import ankleloop
from ankleloop.plotting.style import FILE_OPTIONS

ROOT = Path(__file__).parents[1]
collect_ignore_glob = ["*/conftest.py"]  # they have no examples, and share a name
COMPILED = (".pyc", ".nbi", ".nbc")  # modules and kernels
# Tests that run before all others: the longest, which keeps the processors busy, and those that wait most of the time.
FIRST = ("test_workflow.py", "unit/lab/live", "unit/lab/files")
PARTS = ("Snakefile", "workflow", "config", "notebooks", "data", "src", "profiles")


def pytest_addoption(parser):
    parser.addoption(
        "--update-expected",
        action="store_true",
        help="write tests/regression/expected again from the reduced configuration instead of comparing with it",
    )


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Where tests run in several processes: one for each file, and one for all tests of the shared reproduction."""
    items.sort(key=lambda item: not any(name in item.nodeid for name in FIRST))
    for item in items:
        shared = "repository" in getattr(item, "fixturenames", ())
        item.add_marker(pytest.mark.xdist_group("reproduction" if shared else str(item.path)))


def ignore_partial(folder, names):
    """Files of compiled code that another process is writing: they are gone when they would be copied."""
    return [
        name for name in names if Path(folder).name == "__pycache__" and not name.endswith(COMPILED)
    ]


@pytest.fixture(scope="session")
def copy_repository(tmp_path_factory):
    """Copy the repository, as a user has it, with the kernels that are compiled."""

    def copy():
        folder = tmp_path_factory.mktemp("repository")
        for part in PARTS:
            if (ROOT / part).is_dir():
                shutil.copytree(ROOT / part, folder / part, ignore=ignore_partial)
            else:
                shutil.copy(ROOT / part, folder / part)
        return folder

    return copy


@pytest.fixture(scope="session")
def repository(copy_repository):
    """A copy of the repository that the tests of the whole workflow share."""
    return copy_repository()


@pytest.fixture(scope="session")
def clean(copy_repository):
    """A copy of the repository without results."""
    return copy_repository()


@pytest.fixture
def tiny(tmp_path):
    """Options of a run of one point."""
    path = tmp_path / "tiny.yaml"
    path.write_text(yaml.safe_dump(TINY), encoding="utf-8")
    return "--configfile", str(path)


@pytest.fixture(scope="session")
def snakemake():
    """Run snakemake in a folder, with the library of a copy of the repository, and return its output."""

    def run(repository, *arguments, folder=None, check=True, **variables):
        process = subprocess.run(
            [str(PROGRAM), "--cores", "2", *arguments],
            cwd=folder or repository,
            env=environment(repository, **variables),
            capture_output=True,
            text=True,
        )
        assert not check or process.returncode == 0, process.stdout + process.stderr
        return process.stdout + process.stderr

    return run


@pytest.fixture(scope="session")
def study_file(tmp_path_factory):
    """Configuration of one small study."""
    path = tmp_path_factory.mktemp("config") / "study.yaml"
    path.write_text(yaml.safe_dump(STUDY), encoding="utf-8")
    return path


@pytest.fixture
def start(repository, study_file, tmp_path):
    """Start a run of the small study, or of another configuration, in a folder; the test may leave it running."""
    runs = []

    def start(folder, *arguments, **variables):
        folder.mkdir(exist_ok=True)
        if "--configfile" not in arguments:
            arguments = ("--configfile", str(study_file), *arguments)
        run = Run(repository, folder, tmp_path / f"run{len(runs)}.log", *arguments, **variables)
        runs.append(run)
        return run

    yield start
    for run in runs:
        if run.process.poll() is None:
            run.kill(jobs=True)


@pytest.fixture(scope="session")
def laboratory(tmp_path_factory):
    """A folder of recordings: a good one, in degrees and with the torque turned round, and one with a gap."""
    folder = tmp_path_factory.mktemp("recordings")
    trial = ankleloop.simulate(seed=1, duration=20.0, reflex_gain=5.0, closed_loop=False)
    columns = {
        "t": trial["time"],
        "angle_deg": np.degrees(trial["position"]),
        "tq": -trial["torque"],
    }
    table = pd.DataFrame({name: values.values for name, values in columns.items()})
    table.to_csv(folder / "good.csv.gz", index=False)
    table.loc[777, "tq"] = np.nan
    table.to_csv(folder / "bad.csv", index=False)
    return folder


@pytest.fixture(scope="session")
def reduced(repository, snakemake, laboratory):
    """Run the whole paper, reduced by config/ci.yaml, with a study of recordings; an overlay changes its settings."""
    ci = yaml.safe_load((repository / "config/ci.yaml").read_text(encoding="utf-8"))
    example = yaml.safe_load(
        (repository / "config/recordings.example.yaml").read_text(encoding="utf-8")
    )
    study = example["studies"]["recordings"]
    recording = {
        "subject": "Ann",
        "condition": "rest",
        "position": "angle_deg",
        "torque": "tq",
        "position_unit": "deg",
    }
    names = {"A1": "good.csv.gz", "A2": "bad.csv", "A3": "nowhere.csv"}
    study["files"] = {name: recording | {"file": file} for name, file in names.items()}
    config = ci | {"run": [*ci["run"], "recordings"]}
    config["studies"]["recordings"] = study
    (repository / "config/reduced.yaml").write_text(
        yaml.safe_dump(config, sort_keys=False), encoding="utf-8"
    )

    def run(*arguments, overlay=None, **options):
        (repository / "config/overlay.yaml").write_text(
            yaml.safe_dump(overlay or {}), encoding="utf-8"
        )
        files = ("config/reduced.yaml", *(["config/overlay.yaml"] if overlay else []))
        variables = {"ANKLELOOP_RECORDINGS": str(laboratory)}
        return snakemake(repository, *arguments, "--configfile", *files, **options, **variables)

    return run


@pytest.fixture(scope="session")
def reproduction(repository, reduced):
    """The folder of the one run that all tests of the whole workflow look at; none of them changes its results."""
    (repository / "run.log").write_text(reduced(), encoding="utf-8")
    return repository


@pytest.fixture
def coarse_pictures(monkeypatch):
    """Pictures of few pixels, and none for print, which take less time."""
    for module in ("ankleloop_lab.pages.recordings", "ankleloop.plotting.style"):
        monkeypatch.setattr(f"{module}.DOTS_PER_INCH", 40)
    monkeypatch.delitem(FILE_OPTIONS, ".pdf")


@pytest.fixture
def no_pages(monkeypatch):
    """Pages of recordings without content, because figures take long."""
    module = "ankleloop_lab.results"
    monkeypatch.setattr(f"{module}.draw_figures", lambda *args, **options: {})
    monkeypatch.setattr(f"{module}.render_recording_page", lambda *args, **options: "")
