"""Every block of code in the documentation is run, or checked by what would read it."""

import contextlib
import io
import itertools
import re
import shutil
import textwrap
from pathlib import Path
from typing import NamedTuple

import matplotlib.pyplot as plt
import pandas as pd
import pytest
import yaml
from snakemake.utils import update_config

import ankleloop
from ankleloop_workflow.config.run import read_run
from ankleloop_workflow.config.settings import SimulationStudy

ROOT = Path(__file__).parents[2]
FENCE = re.compile(
    r"^(?P<indent> *)(?P<marks>`{3,})(?P<language>[^\n`]*)\n(?P<code>.*?)^(?P=indent)(?P=marks) *$",
    re.MULTILINE | re.DOTALL,
)
OUTSIDE = ("README.md", "CONTRIBUTING.md", "SECURITY.md", "config/README.md", "data/README.md")


class Block(NamedTuple):
    """A block of code: page and line, language, tags, and the output behind it, if there is one."""

    page: str
    place: str
    language: str
    code: str
    tags: str
    output: str | None = None


def documentation_pages():
    """All pages with text of ours, relative to the repository."""
    return [
        *OUTSIDE,
        *(path.relative_to(ROOT).as_posix() for path in sorted((ROOT / "docs").rglob("*.md"))),
    ]


def read_blocks(page):
    """The blocks of a page; a block `text` that follows another one is its output."""
    text = (ROOT / page).read_text(encoding="utf-8")
    blocks, end = [], 0
    for match in FENCE.finditer(text):
        language, code = match["language"].strip(), textwrap.dedent(match["code"])
        if (
            language == "text"
            and blocks
            and not text[end : match.start()].strip()
            and blocks[-1].output is None
        ):
            blocks[-1] = blocks[-1]._replace(output=code)
        else:
            tags = re.match(r":tags: \[(.*)\]\n", code)
            code = code[tags.end() :] if tags else code
            language = "python" if language == "{code-cell} python" else language
            line = text.count("\n", 0, match.start()) + 1
            blocks.append(Block(page, f"{page}:{line}", language, code, tags[1] if tags else ""))
        end = match.end()
    return blocks


def top_level_parts(code):
    """A block of YAML, cut before each line that begins a key at the top level.

    Blocks that show alternatives have a key several times, which no YAML file may have.
    """
    parts = re.split(r"^(?=[\w-]+:)", code, flags=re.MULTILINE)
    return [part for part in parts if re.match(r"[\w-]+:", part)]


BLOCKS = [block for page in documentation_pages() for block in read_blocks(page)]
CONFIG = ROOT / "config" / "config.yaml"
ERROR = re.compile(r"\w+Error: ")

# What a page takes for granted: files of the reader (the fixture `folder`), and names of an earlier page.
SIMULATED = "trial = another_trial = ankleloop.simulate(seed=1, duration=20.0)\n"
BEFORE = {
    "docs/reference/estimates.md": f"import ankleloop\n{SIMULATED}estimate = ankleloop.identify(trial, 'pr-moesp')\n",
    "docs/how-to/recordings.md": f"import ankleloop\n{SIMULATED}",
}


# tests/nightly runs the study of the first page with its method, tests/integration the notebook of the other.
METHOD, NOTEBOOK = "docs/tutorials/add-a-method.md", "docs/how-to/own-notebook.md"
YAML = [
    block for block in BLOCKS if block.language == "yaml" and block.page not in (METHOD, NOTEBOOK)
]


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """The files that readers of the pages have: recordings in several states, a table of trials."""
    folder = tmp_path_factory.mktemp("files")
    trial = ankleloop.simulate(seed=1, duration=30.0)
    table = pd.DataFrame(
        {name: trial[name].to_numpy() for name in ("time", "position", "torque", "reference")}
    )
    table.to_csv(folder / "trial.csv", index=False)
    table.drop(columns="time").to_csv(folder / "no-times.csv", index=False)
    table.drop(index=range(300, 350)).to_csv(folder / "gap.csv", index=False)
    table.assign(position=table["position"].where(table.index != 100)).to_csv(
        folder / "missing.csv", index=False
    )
    table.rename(columns={"position": "angle_deg"}).to_csv(folder / "degrees.csv", index=False)
    table.assign(knee_angle=table["position"]).to_csv(folder / "two-angles.csv", index=False)
    table.to_csv(folder / "no-names.csv", header=False, index=False)
    table.rename(columns={"torque": "torque_ftlb"}).to_csv(folder / "feet.csv", index=False)
    for name in ("S1.csv", "S2.csv", "S1.mat", "S2.mat"):
        turned = table.assign(torque=-table["torque"])
        turned.to_csv(folder / name, index=False) if name.endswith("csv") else (
            folder / name
        ).touch()
    for number in range(1, 4):
        part = table[(number - 1) * 10_000 : number * 10_000]
        part.assign(time=part["time"] - part["time"].iloc[0]).to_csv(
            folder / f"part{number}.csv", index=False
        )
    write_sweep(folder / "results" / "tables" / "sweep-trials.parquet")
    (folder / "sweep.csv").write_text("reflex_gain\n8.0\n12.0\n", encoding="utf-8")
    return folder


def write_sweep(path):
    """A table of trials over two settings, as the workflow writes it."""
    path.parent.mkdir(parents=True)
    rows = itertools.product((8.0, 13.0), (0.1, 0.5), ("riv", "pr-moesp"), range(3))
    columns = ["point.reflex_gain", "point.voluntary", "method", "trial"]
    table = pd.DataFrame(rows, columns=columns)
    gains, levels = table["point.reflex_gain"], table["point.voluntary"]
    table["point"] = "g=" + gains.astype(str) + ",v=" + levels.astype(str)
    table["vaf_reflex_true"] = 99.0 - levels - table["trial"] / 10
    table = table.assign(study="s", failure=None, warnings="")
    table.astype(dict.fromkeys(("study", "point", "method"), "category")).to_parquet(path)


@pytest.fixture
def folder(files, tmp_path, monkeypatch):
    """A folder with the files of a reader, as working directory."""
    shutil.copytree(files, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("ankleloop_lab.experiments.perturbation.GENERATIONS", 8)  # a shorter search
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


# Pages whose code is hidden, and only draws, run with the site in tests/nightly.
SHOWN = {
    block.page
    for block in BLOCKS
    if block.language == "python" and block.tags != "remove-input" and block.page != NOTEBOOK
}


@pytest.mark.parametrize("page", sorted(SHOWN))
def test_python_runs_and_prints_what_the_page_shows(page, folder):
    names = {"__name__": "__main__"}
    with plt.rc_context({"backend": "Agg"}):
        exec(BEFORE.get(page, ""), names)
        for block in BLOCKS:
            if (block.page, block.language) == (page, "python"):
                run_python(block, names)
        plt.close("all")


def check_config(text):
    Path("mine.yaml").write_text(text, encoding="utf-8")
    config = yaml.safe_load(CONFIG.read_text(encoding="utf-8"))
    update_config(config, yaml.safe_load(text))
    read_run(config, [str(CONFIG), "mine.yaml"])


def check_part(part):
    """Check keys that stand below the name of a study."""
    study = {
        "trials": 1,
        "seed": 1,
        "methods": {name: {"method": name} for name in ("riv", "pr-moesp")},
    }
    SimulationStudy(**{**study, **part})


@pytest.mark.parametrize("block", YAML, ids=lambda block: block.place)
def test_yaml_is_what_the_models_of_the_configuration_take(block, files, monkeypatch):
    monkeypatch.chdir(files)
    keys = set(yaml.safe_load(top_level_parts(block.code)[0]))
    if block.page == "docs/how-to/clusters.md":
        profile = yaml.safe_load((ROOT / "profiles/slurm/profile.yaml").read_text(encoding="utf-8"))
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
