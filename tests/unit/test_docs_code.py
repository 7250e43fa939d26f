"""Every block of code in the documentation is run, or checked by what would read it."""

import contextlib
import io
import re
import shutil
from functools import cache
from pathlib import Path

import matplotlib.pyplot as plt
import pandas as pd
import pytest
import yaml
from docs_blocks import ROOT, documentation_pages, read_blocks, top_level_parts

import ankleloop
from ankleloop.studies.config import SimulationStudy
from ankleloop.studies.run_config import read_run

PAGES = documentation_pages()
BLOCKS = [block for page in PAGES for block in read_blocks(page)]
ERROR = re.compile(r"\w+Error: ")

# What a page takes for granted: files of the reader (the fixture `folder`), and names of an earlier page.
SIMULATED = "trial = another_trial = ankleloop.simulate(seed=1, duration=20.0)\n"
BEFORE = {
    "docs/reference/estimates.md": f"import ankleloop\n{SIMULATED}estimate = ankleloop.identify(trial, 'pr-moesp')\n",
    "docs/how-to/recordings.md": f"import ankleloop\n{SIMULATED}",
    "docs/reliability.md": "from bad_inputs.csv_files import row, csv_file\nfrom bad_inputs.inputs import TIME\n"
    "gap = TIME + 1.0 * (TIME > TIME[100])\n",
}


def of_language(language, without=None):
    blocks = [block for block in BLOCKS if block.language == language and block.page != without]
    return pytest.mark.parametrize("block", blocks, ids=[block.place for block in blocks])


def pages_with(language):
    return [page for page in PAGES if any(block.page == page and block.language == language for block in BLOCKS)]


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """The files that readers of the pages have: recordings in several states, a long one, a table of trials."""
    folder = tmp_path_factory.mktemp("files")
    trial = ankleloop.simulate(seed=1, duration=30.0)
    table = pd.DataFrame({name: trial[name].to_numpy() for name in ("time", "position", "torque", "reference")})
    table.to_csv(folder / "trial.csv", index=False)
    table.drop(columns="time").to_csv(folder / "no-times.csv", index=False)
    table.drop(index=range(300, 350)).to_csv(folder / "gap.csv", index=False)
    table.assign(position=table["position"].where(table.index != 100)).to_csv(folder / "missing.csv", index=False)
    table.rename(columns={"position": "angle_deg"}).to_csv(folder / "degrees.csv", index=False)
    table.to_csv(folder / "semicolons.csv", sep=";", decimal=",", index=False)
    for name in ("S1.csv", "S2.csv", "S1.mat", "S2.mat"):
        turned = table.assign(torque=-table["torque"])
        turned.to_csv(folder / name, index=False) if name.endswith("csv") else (folder / name).touch()
    for number in range(1, 4):
        part = table[(number - 1) * 10_000 : number * 10_000]
        part.assign(time=part["time"] - part["time"].iloc[0]).to_csv(folder / f"part{number}.csv", index=False)
    write_long_record(folder / "long.h5", table)
    write_sweep(folder / "results" / "tables" / "sweep-trials.parquet")
    (folder / "sweep.csv").write_text("reflex_gain\n8.0\n12.0\n", encoding="utf-8")
    return folder


def write_long_record(path, table):
    import h5py

    every = slice(None, None, 10)
    with h5py.File(path, "w") as file:
        file["angle"] = table["position"].to_numpy()[every]
        file["moment"] = -table["torque"].to_numpy()[every]
        file["command"] = table["reference"].to_numpy()[every]


def write_sweep(path):
    """A table of trials over two settings, as the workflow writes it."""
    path.parent.mkdir(parents=True)
    rows = [
        {"study": "s", "point": f"g={gain},v={voluntary}", "reflex_gain": gain, "voluntary": voluntary}
        | {"method": method, "trial": trial, "vaf_reflex_true": 99.0 - voluntary - trial / 10}
        | {"failure": None, "warnings": ""}
        for gain in (8.0, 13.0)
        for voluntary in (0.1, 0.5)
        for method in ("riv", "pr-moesp")
        for trial in range(3)
    ]
    table = pd.DataFrame(rows)
    table.astype(dict.fromkeys(("study", "point", "method"), "category")).to_parquet(path)


@pytest.fixture
def folder(files, tmp_path, monkeypatch):
    """A folder with the files of a reader, as working directory."""
    shutil.copytree(files, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def as_words(text):
    return " ".join(text.split())


def run_python(block, names):
    """Run a block; its output, or its error, has to be the one that the page shows."""
    expected = None if block.output is None else as_words(block.output)
    code, printed = compile(block.code, block.place, "exec"), io.StringIO()
    if "raises-exception" in block.tags or (expected is not None and ERROR.match(expected)):
        with pytest.raises(Exception, match=r".") as caught:
            exec(code, names)
        printed.write(f"{caught.type.__name__}: {caught.value}")
    else:
        with contextlib.redirect_stdout(printed):
            exec(code, names)
    assert expected is None or as_words(printed.getvalue()) == expected, block.place


@pytest.mark.parametrize("page", pages_with("python"))
def test_python_runs_and_prints_what_the_page_shows(page, folder):
    names = {"__name__": "__main__"}
    with plt.rc_context({"backend": "Agg"}):
        exec(BEFORE.get(page, ""), names)
        for block in read_blocks(page):
            if block.language == "python":
                run_python(block, names)
        plt.close("all")


@cache
def config_text():
    return (ROOT / "config" / "config.yaml").read_text(encoding="utf-8")


def merge(base, changes):
    """Override keys, as Snakemake does with files of --configfile."""
    for key, value in changes.items():
        base[key] = merge(base[key], value) if isinstance(value, dict) and isinstance(base.get(key), dict) else value
    return base


def check_config(text):
    Path("mine.yaml").write_text(text, encoding="utf-8")
    config = merge(yaml.safe_load(config_text()), yaml.safe_load(text))
    read_run(config, [str(ROOT / "config" / "config.yaml"), "mine.yaml"])


def check_part(part):
    """A part of a study: keys that stand below its name."""
    study = {"trials": 1, "seed": 1, "methods": {name: {"method": name} for name in ("riv", "pr-moesp")}}
    SimulationStudy(**{**study, **part})


@of_language("yaml", without="docs/tutorials/add-a-method.md")  # test_docs_tutorial.py adds its method, and runs it
def test_yaml_is_what_the_models_of_the_configuration_take(block, folder, monkeypatch):
    keys = set(yaml.safe_load(top_level_parts(block.code)[0]))
    if block.page == "docs/how-to/clusters.md":
        profile = yaml.safe_load((ROOT / "profiles/slurm/config.yaml").read_text(encoding="utf-8"))
        assert set(yaml.safe_load(block.code)) <= set(profile)
    elif block.output is not None:
        with pytest.raises(Exception, match=r".") as caught:
            check_config(block.code)
        assert as_words(f"{caught.type.__name__}: {caught.value}") == as_words(block.output)
    elif keys <= {"run", "studies", "article"}:
        check_config(block.code)
    else:
        for part in map(yaml.safe_load, top_level_parts(block.code)):
            check_part({"kind": "simulation", **part})
