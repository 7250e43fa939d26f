"""The whole DAG, in a copy of the repository, as a user runs it."""

import os
import re
from collections import Counter

import numpy as np
import pandas as pd
import pytest
import yaml

import ankleloop
from ankleloop.replication.results import read_results
from ankleloop.replication.trial_counts import COUNTS, count_outcomes, count_trials
from ankleloop.replication.trial_tables import read_trial_table
from ankleloop.studies.seeds import trial_entropy

pytestmark = pytest.mark.workflow


CI = ("--configfile", "config/ci.yaml")


@pytest.fixture(scope="module")
def plan(snakemake):
    """Number of jobs that a dry run plans, by rule and study."""

    def plan(folder, *arguments):
        text = snakemake(folder, "--dry-run", *arguments)
        blocks = re.split(r"^(?:local)?rule (\w+):$", text.split("Job stats:")[-2], flags=re.MULTILINE)
        jobs = []
        for rule, block in zip(blocks[1::2], blocks[2::2], strict=True):
            study = re.search(r"wildcards:.*\bstudy=([\w-]+)", block)
            jobs.append(f"{rule} {study[1]}" if study else rule)
        return Counter(job for job in jobs if job != "everything")

    return lambda folder, *arguments: dict(plan(folder, *arguments))


# Summaries of all studies, which follow any change in one of them; the economy is measured on Table 1.
SUMMARIES = {"verify": 1, "article": 1, "crate": 1, "index": 1}
ECONOMY = {"economy": 1}


def report_jobs(study, figures):
    return {f"small_trial_table {study}": 1, f"report {study}": 1, f"figure {study}": figures}


def page(path):
    text = path.read_text(encoding="utf-8")
    # Nothing is fetched: pictures are embedded, and scripts are in the page; tests/browser looks at it in a browser.
    body = re.sub(r"<script>.*?</script>", "", text, flags=re.DOTALL)
    assert not re.search(r"""(src|href)\s*=\s*["']?(https?:)?//""", body)
    assert "default-src 'none'" in body
    assert "unsafe-eval" not in body
    assert 'class="back" href="' in body
    assert "data:image/png;base64" in text
    assert "Traceback" not in text
    assert not re.search(r"\w+Warning: ", text)
    return text


def test_table_and_figure_of_the_paper(reproduction):
    table = pd.read_csv(reproduction / "results/tables/table1.csv")
    assert list(table.columns)[:8] == ["gain", "method", "torque", "against", "paper", "mean", "sd", "n"]
    assert list(table.columns)[8:] == COUNTS
    methods = ["pr-moesp", "eiv-moesp", "parallel-cascade-one-pass", "parallel-cascade", "pr-moesp-free-b"]
    assert list(table["method"].unique()) == methods
    assert set(table["n"]) == {4}
    assert set(table["gain"]) == {13.0, 2.0}
    value = table[table["gain"] == 13.0].set_index(["method", "torque", "against"])
    assert value.loc[("pr-moesp", "net", "measured"), "paper"] == 92
    assert value.loc[("parallel-cascade-one-pass", "intrinsic", "true"), "paper"] == 56
    # What the table says of the methods holds in two short trials, too.
    assert value.loc[("pr-moesp", "intrinsic", "true"), "mean"] > 97
    assert value.loc[("parallel-cascade", "intrinsic", "true"), "mean"] > 97
    assert 40 < value.loc[("parallel-cascade-one-pass", "intrinsic", "true"), "mean"] < 75
    markdown = (reproduction / "results/tables/table1.md").read_text(encoding="utf-8")
    assert "PR-MOESP" in markdown
    assert "N·m/rad" in markdown
    for end in ("png", "pdf", "csv"):
        assert (reproduction / f"results/figures/table1-figure3.{end}").stat().st_size > 10_000
    assert "PR-MOESP" in page(reproduction / "results/reports/table1.html")


def test_every_table_of_means_counts_trials_failures_and_warnings(reproduction):
    for path in (reproduction / "results/tables").glob("*.csv"):
        # The economy is that of runs that cannot fail; tables of trials have no means.
        if path.stem == "economy" or path.stem.endswith("-trials"):
            continue
        table = pd.read_csv(path)
        details = read_results((reproduction / "results/parameters" / path.stem).glob("*.csv"))
        assert set(COUNTS) <= set(table), path.name
        assert (table["trials"] == count_trials(details)).all(), path.name
        assert table["failures"].max() == 0, path.name
        expected = count_outcomes(details, ["point", "method"])["warnings"]
        if path.stem != "obstacles":  # there each warning that names the step is left out
            assert expected.min() <= table["warnings"].min() <= table["warnings"].max() <= details["trial"].max() + 1
        page = (path.with_suffix(".md")).read_text(encoding="utf-8")
        assert all(name in page for name in COUNTS), path.name


def test_the_table_of_all_trials_has_every_parameter_and_score(reproduction):
    for path in (reproduction / "results/tables").glob("*-trials.parquet"):
        study = path.stem.removesuffix("-trials")
        key = ["point", "method", "trial"]
        table = read_trial_table(path).astype({"point": str, "method": str}).set_index(key).sort_index()
        parameters = read_results((reproduction / "results/parameters" / study).glob("*.csv")).set_index(key)
        assert table.index.is_unique
        assert list(table.index) == sorted(parameters.index)
        scores = read_results((reproduction / "results/scores" / study).glob("*.csv"))
        for (torque, against), rows in scores.groupby(["torque", "against"]):
            values = table[f"vaf_{torque}_{against}"].dropna()
            assert values.equals(rows.set_index(key)["vaf"].sort_index().rename(values.name))


def test_scores_are_means_of_trials(reproduction):
    table = pd.read_csv(reproduction / "results/tables/table1.csv").query("gain == 13")
    table = table.set_index(["method", "torque", "against"])
    scores = pd.read_csv(reproduction / "results/scores/table1/0.csv")
    assert list(scores.columns) == [
        "study",
        "point",
        "reflex_gain",
        "method",
        "trial",
        "torque",
        "against",
        "vaf",
        "low",
        "high",
    ]
    for key, rows in scores.groupby(["method", "torque", "against"]):
        row = table.loc[key]
        assert row["mean"] == pytest.approx(rows["vaf"].mean(), abs=1e-9)
        assert row["sd"] == pytest.approx(rows["vaf"].std(), abs=1e-9)


def test_a_trial_of_the_workflow_can_be_simulated_alone(reproduction):
    """The seed is keyed by study, point and trial, so the library gives the same scores without the workflow."""
    seed = np.random.SeedSequence(trial_entropy(2008, "table1", "reflex_gain=13.0", 1))
    trial = ankleloop.simulate(seed=seed, reflex_gain=13.0, duration=20.0)
    scores = pd.read_csv(reproduction / "results/scores/table1/0.csv")
    scores = scores.query("point == 'reflex_gain=13.0' and trial == 1 and method == 'pr-moesp'")
    np.testing.assert_allclose(
        ankleloop.evaluate(trial, ankleloop.identify(trial, "pr-moesp"))["vaf"], scores["vaf"], atol=1e-6
    )


def test_nothing_is_left_to_do_and_nothing_half_written(reproduction, plan, snakemake):
    assert "Nothing to be done" in snakemake(reproduction, "--dry-run", *CI)
    assert not list((reproduction / "results").rglob("*.part"))
    hidden = [path.name for path in (reproduction / "results").rglob(".*")]
    assert set(hidden) <= {".snakemake_timestamp"}


def overlay(folder, study="table1", **settings):
    """The reduced configuration with settings of a study changed."""
    path = folder / "config" / "overlay.yaml"
    config = yaml.safe_load((folder / "config/ci.yaml").read_text(encoding="utf-8"))
    config["studies"][study] |= settings
    path.write_text(yaml.safe_dump(config, sort_keys=False), encoding="utf-8")
    return "--configfile", "config/overlay.yaml"


def test_a_changed_option_identifies_again_and_does_not_simulate_again(reproduction, plan):
    methods = {"pr-moesp": {"options": {"block_rows": 20}}}
    jobs = plan(reproduction, *overlay(reproduction, methods=methods))
    assert jobs == {"identify table1": 2} | report_jobs("table1", 2) | ECONOMY | SUMMARIES


def test_a_new_point_at_the_end_leaves_the_others_alone(reproduction, plan):
    jobs = plan(reproduction, *overlay(reproduction, points={"reflex_gain": [13.0, 2.0, 5.0]}))
    assert jobs == {"simulate table1": 1, "identify table1": 1} | report_jobs("table1", 2) | ECONOMY | SUMMARIES


def test_a_changed_value_reruns_its_chunk_alone(reproduction, plan):
    jobs = plan(reproduction, *overlay(reproduction, points={"reflex_gain": [13.0, 5.0]}))
    assert jobs == {"simulate table1": 1, "identify table1": 1} | report_jobs("table1", 2) | ECONOMY | SUMMARIES


def test_one_setting_reruns_exactly_what_depends_on_it(reproduction, plan):
    """The voluntary torque of Table 2: its trials, estimates, scores and page; the ledger; the article."""
    jobs = plan(reproduction, *overlay(reproduction, "table2", simulation={"duration": 20.0, "voluntary": 0.4}))
    assert jobs == {"simulate table2": 1, "identify table2": 1} | report_jobs("table2", 1) | SUMMARIES


@pytest.fixture
def touch(reproduction):
    """Change a module of the library until the end of the test."""
    texts = {}

    def change(module):
        path = reproduction / "src/ankleloop" / module
        texts[path] = path.read_text(encoding="utf-8")
        path.write_text(f"{texts[path]}\n# changed\n", encoding="utf-8")

    yield change
    for path, text in texts.items():
        path.write_text(text, encoding="utf-8")


def test_a_changed_library_reruns_what_uses_it(reproduction, plan, touch):
    touch("methods/moesp.py")
    jobs = plan(reproduction, *CI)
    studies = yaml.safe_load((reproduction / "config/ci.yaml").read_text(encoding="utf-8"))["studies"]
    assert {job for job in jobs if job.startswith("identify")} == {f"identify {name}" for name in studies}
    assert not [job for job in jobs if job.startswith("simulate")]
    assert "diagrams" not in jobs


def test_a_changed_diagram_reruns_what_draws_it(reproduction, plan, touch):
    touch("plotting/diagrams.py")
    assert plan(reproduction, *CI) == {"diagrams": 1, "article": 1, "crate": 1, "index": 1}


def test_a_changed_template_reruns_the_pages(reproduction, plan, touch):
    touch("pages/templates/base.html.j2")
    jobs = plan(reproduction, *CI)
    assert {job.split()[0] for job in jobs} == {"report", "figure", "article", "crate", "index"}


def test_the_whole_paper_is_there(reproduction):
    """Figures 1 to 5 and Tables 1 and 2, the ledger and the article."""
    figures = ["figure1", "figure2", "table1-figure3", "figure4-figure4", "table2-figure5", "passes-passes"]
    for name in [*figures, "voluntary-stiffness", "load-vaf", "real-time-traces"]:
        ends = ("png", "pdf") if name in ("figure1", "figure2") else ("png", "pdf", "csv")
        for end in ends:
            assert (reproduction / f"results/figures/{name}.{end}").stat().st_size > (4_000 if end != "csv" else 500)
    ledger = pd.read_csv(reproduction / "results/verification.csv")
    claims = pd.read_csv(reproduction / "data/published/claims.csv")
    assert set(claims["id"]) <= set(ledger["id"])
    assert len(ledger) == len(claims) + 18
    assert ledger["reason"].notna().all()
    markdown = (reproduction / "results/verification.md").read_text(encoding="utf-8")
    assert all(name in markdown for name in ledger["id"])
    article = page(reproduction / "results/article.html")
    for text in ("Figure 1.", "Figure 2.", "Table 1.", "Figure 3.", "Figure 4.", "simulated stand-in", "Figure 5"):
        assert text in article
    table = pd.read_csv(reproduction / "results/tables/table2.csv")
    assert {"vaf_net", "paper_net"} <= set(table)
    for study in ("table2", "figure4", "passes", "voluntary", "load", "projection", "real-time"):
        page(reproduction / f"results/reports/{study}.html")
    assert "stand-in" in page(reproduction / "results/reports/table2.html")


def test_a_wrong_key_stops_before_any_job(reproduction, snakemake):
    text = snakemake(reproduction, *overlay(reproduction, trails=3), check=False)
    assert "config → studies → table1: unknown key 'trails' (did you mean 'trials'?); known here: " in text
    assert "rule simulate" not in text


def test_an_unstable_point_is_named_and_leaves_nothing(reproduction, snakemake):
    settings = {"load_inertia": 0.1, "load_viscosity": 5.0, "load_stiffness": 100.0, "duration": 20.0}
    points = {"reflex_gain": [13.0, 2.0, 29.0]}
    arguments = overlay(reproduction, simulation=settings, points=points, failures="stop")
    text = snakemake(reproduction, "results/trials/table1/2.nc", *arguments, check=False)
    assert "the closed loop is unstable" in text
    assert "load_inertia=0.1" in text
    assert not (reproduction / "results/trials/table1/2.nc").exists()


@pytest.fixture(scope="module")
def laboratory(tmp_path_factory):
    """A folder of recordings: one good file, in degrees and with the torque the other way round, and a broken one."""
    folder = tmp_path_factory.mktemp("recordings")
    trial = ankleloop.simulate(seed=1, duration=20.0, reflex_gain=5.0, closed_loop=False)
    columns = {"t": trial["time"], "angle_deg": np.degrees(trial["position"]), "tq": -trial["torque"]}
    table = pd.DataFrame({name: values.values for name, values in columns.items()})
    table.to_csv(folder / "good.csv.gz", index=False)
    table.loc[777, "tq"] = np.nan
    table.to_csv(folder / "bad.csv", index=False)
    return folder


def recordings(folder, files):
    """The example with other files, listed by a table."""
    rows = ["name,file,subject,condition,position,torque,position_unit,torque_sign"]
    rows += [f"{name},{file},Ann,{condition},angle_deg,tq,deg,-1" for name, (file, condition) in files.items()]
    (folder / "config/laboratory.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    example = yaml.safe_load((folder / "config/recordings.example.yaml").read_text(encoding="utf-8"))
    example["studies"]["recordings"].pop("files")
    example["studies"]["recordings"]["table"] = "config/laboratory.csv"
    (folder / "config/laboratory.yaml").write_text(yaml.safe_dump(example, sort_keys=False), encoding="utf-8")
    return "--configfile", "config/laboratory.yaml"


def test_recordings_of_a_laboratory(repository, laboratory, snakemake):
    """A good one, one with a gap and one that is not there: the last two are refused, the first one finishes."""
    files = {"A1": ("good.csv.gz", "rest"), "A2": ("bad.csv", "rest"), "A3": ("nowhere.csv", "active")}
    text = snakemake(repository, *recordings(repository, files), ANKLELOOP_RECORDINGS=str(laboratory))
    table = pd.read_csv(repository / "results/tables/recordings.csv")
    good = table[table["recording"] == "A1"].set_index("method")
    assert list(good.index) == ["riv", "pi-moesp", "pr-moesp-position", "parallel-cascade"]
    assert (good["K"] / 150.0 - 1).abs().max() < 0.2
    assert (good[["B", "I"]] > 0).all(axis=None)
    assert (good["vaf_net"] > 88).all()
    assert (good["vaf_unseen"] > 80).all()
    assert (good["subject"] == "Ann").all()
    assert good.loc["pr-moesp-position", "reference"] == "position"
    refused = table[table["verdict"] == "refused"].set_index("recording")["reasons"]
    assert "777" in refused["A2"]  # the sample
    assert "there is no file nowhere.csv" in refused["A3"]
    assert "A2 refused" in text
    summary = page(repository / "results/reports/recordings.html")
    assert "position as reference" in summary
    assert "nowhere.csv" in summary
    assert "cannot be told without a usable reference" in page(repository / "results/reports/recordings/A1.html")
    assert "nowhere.csv" in (repository / "results/reports/recordings/A3.html").read_text(encoding="utf-8")
    assert (repository / "results/figures/recordings-group.png").stat().st_size > 10_000
    folder = repository / "results/estimates/recordings/A1"
    numbers = sorted(path.stem.removeprefix("figure-") for path in folder.glob("figure-*.csv"))
    assert numbers == ["models", "residuals", "spectra", "torques"]
    exported = sorted(path.name for path in folder.glob("[a-z]*") if not path.name.startswith("figure-"))
    assert exported[:3] == ["parallel-cascade.csv", "parallel-cascade.mat", "parallel-cascade.nc"]
    assert len(exported) == 12


def test_recordings_need_their_folder(repository, laboratory, snakemake):
    unset = snakemake(repository, *recordings(repository, {"A1": ("good.csv.gz", "rest")}), check=False)
    assert "ANKLELOOP_RECORDINGS" in unset
    assert "not set" in unset


@pytest.mark.skipif(
    "ANKLELOOP_RECORDINGS" not in os.environ,
    reason="set ANKLELOOP_RECORDINGS to the folder with the real recordings to run this",
)
def test_real_recordings(repository, snakemake):
    folder = os.environ["ANKLELOOP_RECORDINGS"]
    snakemake(repository, "--configfile", "config/recordings.example.yaml", ANKLELOOP_RECORDINGS=folder)
    table = pd.read_csv(repository / "results/tables/recordings.csv").set_index(["recording", "method"])
    assert (table[["K", "B", "I"]] > 0).all(axis=None)
    for recording, net in (("z_df", 93.4), ("z_pf", 87.7), ("z_df3", 93.4)):
        assert table.loc[(recording, "pi-moesp"), "vaf_net"] > net - 1
        assert table.loc[(recording, "parallel-cascade"), "vaf_net"] > net - 1
        unseen = table.loc[recording]["vaf_unseen"]
        assert unseen.drop("parallel-cascade").max() > unseen["parallel-cascade"] - 0.5
        assert set(table.loc[recording]["loop"]) == {"undecided"}
    page(repository / "results/reports/recordings.html")
