"""The configuration: schema against library, errors that name the key, points and seeds."""

from copy import deepcopy
from pathlib import Path

import pytest
import yaml

import ankleloop
from ankleloop.simulation import parameter_table

from fingerprint import ROOT, fingerprint
from studies import (
    SCHEMA,
    ConfigError,
    batches,
    complete,
    existing,
    identify_options,
    reports,
    scores,
    studies,
    targets,
    trial_seeds,
)

DEFINITIONS = yaml.safe_load(SCHEMA.read_text(encoding="utf-8"))["$defs"]
CONFIG = yaml.safe_load((ROOT / "config" / "config.yaml").read_text(encoding="utf-8"))


def changed(*path, value):
    """The paper's configuration with one key set."""
    config = deepcopy(CONFIG)
    place = config
    for key in path[:-1]:
        place = place.setdefault(key, {})
    place[path[-1]] = value
    return config


def test_simulation_parameters_are_those_of_the_library():
    schema = DEFINITIONS["simulation"]["properties"]
    table = parameter_table()
    assert list(schema) == list(table) == DEFINITIONS["simulation_parameter"]["enum"]
    for name, entry in table.items():
        for key in ("default", "unit", "description"):
            assert schema[name][key] == entry[key], (name, key)
        for key in ("minimum", "maximum", "exclusiveMinimum"):
            assert schema[name].get(key) == entry[key], (name, key)
        assert ("null" in schema[name].get("type", ())) == entry["optional"], name
        assert schema[name].get("enum") == (list(entry["choices"]) if entry["choices"] else None), name


def test_methods_and_their_options_are_those_of_the_library():
    names = DEFINITIONS["methods"]["additionalProperties"]["properties"]["method"]["enum"]
    assert names == list(ankleloop.METHODS)
    for method in names:
        options = "moesp" if method.endswith("moesp") else method.replace("-", "_")
        schema = DEFINITIONS[f"{options}_options"]["properties"]
        assert {name: entry["default"] for name, entry in schema.items()} == ankleloop.method_options(method)


def leaves(schema, path=()):
    for name, entry in schema.get("properties", {}).items():
        yield (*path, name), entry
        yield from leaves(entry, (*path, name))
    for key in ("additionalProperties", "then", "else"):
        if isinstance(schema.get(key), dict):
            yield from leaves(schema[key], (*path, key))


def test_every_key_explains_itself():
    for group, schema in DEFINITIONS.items():
        for path, entry in leaves(schema, (group,)):
            if "$ref" in entry or "const" in entry or path[-1] == "options":
                continue
            assert entry.get("description"), path
            if {"number", "integer"} & set(
                [entry["type"]] if isinstance(entry.get("type"), str) else entry.get("type", [])
            ):
                assert entry.get("unit"), path


def test_defaults_are_filled_in():
    study = studies(complete(CONFIG))["table1"]
    assert study.points["reflex_gain=2.0"]["load_inertia"] == 1.1
    assert study.points["reflex_gain=13.0"]["reflex_gain"] == 13.0
    assert study.methods["pr-moesp"]["options"]["block_rows"] == 15
    assert study.methods["parallel-cascade-one-pass"]["options"]["max_passes"] == 1
    assert study.methods["parallel-cascade"]["options"]["max_passes"] is None
    assert "simulation" in CONFIG["studies"]["table1"]
    assert "load_inertia" not in CONFIG["studies"]["table1"]["simulation"]  # the given mapping is left alone


@pytest.mark.parametrize(
    ("config", "message"),
    [
        (changed("studdies", value={}), r"config: .*'studdies' was unexpected.*known here: run, article, studies"),
        (
            changed("studies", "table1", "trails", value=3),
            r"config → studies → table1: .*'trails' was unexpected.*trials",
        ),
        (changed("studies", "table1", "trials", value=0), r"table1 → trials \[1\]: 0 is less than the minimum of 1"),
        (changed("studies", "table1", "seed", value="x"), r"table1 → seed \[1\]: 'x' is not of type 'integer'"),
        (changed("studies", "table1", "simulation", "stifness", value=1), "simulation: .*'stifness' was unexpected"),
        (changed("studies", "table1", "simulation", "duration", value=-1), r"simulation → duration \[s\]: -1 is less"),
        (changed("studies", "table1", "points", "gain", value=[1]), "'gain' is not one of"),
        (changed("studies", "table1", "points", "reflex_gain", value=[-2.0]), r"reflex_gain=-2.0 → reflex_gain \[N"),
        (
            changed("studies", "table1", "methods", "a", value={"method": "pr-moes"}),
            "a → method: 'pr-moes' is not one of",
        ),
        (
            changed("studies", "table1", "methods", "a", value={"method": "pr-moesp", "options": {"passes": 1}}),
            "a → options: .*'passes' was unexpected",
        ),
        (
            changed("studies", "table1", "methods", "a", value={"method": "parallel-cascade", "options": {"order": 2}}),
            "a → options: .*'order' was unexpected.*known here: delay",
        ),
        (changed("studies", "table1", "kind", value="recording"), "kind: 'recording' is not one of"),
        (changed("run", value=["table3"]), "run: there is no study 'table3'; there are .*table1"),
        (changed("article", value=["table3"]), "article: there is no study 'table3'; there are .*table1"),
        (changed("studies", "table1", "points", value=[{"gain": 1.0}]), "'gain' is not one of"),
        (changed("studies", "table1", "precision", value="half"), "precision: 'half' is not one of"),
    ],
)
def test_a_wrong_key_is_named(config, message):
    with pytest.raises(ConfigError, match=message):
        complete(config)


def test_points_are_all_combinations():
    config = changed("studies", "table1", "points", value={"reflex_gain": [2.0, 13.0], "voluntary": [0.0, 0.3, 1.0]})
    study = studies(complete(config))["table1"]
    assert len(study.points) == 6
    assert study.combinations["reflex_gain=13.0,voluntary=0.3"] == {"reflex_gain": 13.0, "voluntary": 0.3}
    assert len(scores(study)) == 6
    assert study.varied == ["reflex_gain", "voluntary"]
    none = studies(complete(changed("studies", "table1", "points", value={})))["table1"]
    assert list(none.points) == ["only"]


def test_points_may_be_a_list():
    chosen = [{"load_stiffness": 50.0, "load_inertia": 0.2}, {"load_stiffness": 500.0}]
    study = studies(complete(changed("studies", "table1", "points", value=chosen)))["table1"]
    assert list(study.points) == ["load_inertia=0.2,load_stiffness=50.0", "load_stiffness=500.0"]
    assert study.points["load_stiffness=500.0"]["load_inertia"] == 1.1
    assert study.varied == ["load_stiffness", "load_inertia"]


def test_the_order_of_parameters_does_not_matter():
    one, other = ({"load_stiffness": [50.0], "load_inertia": [0.2]}, {"load_inertia": [0.2], "load_stiffness": [50.0]})
    names = [
        list(studies(complete(changed("studies", "load", "points", value=v)))["load"].points) for v in (one, other)
    ]
    assert names[0] == names[1]


def test_the_article_is_made_where_all_its_studies_are():
    made = targets(complete(CONFIG))
    assert {"results/article.html", "results/verification.csv", "results/figures/figure2.svg"} <= set(made)
    part = targets(complete(changed("run", value=["table1"])))
    assert "results/tables/table1.csv" in part
    assert "results/article.html" not in part


def test_seeds_differ_by_study_point_and_trial():
    study = studies(complete(CONFIG))["table1"]
    seeds = [tuple(seed) for point in study.points for seed in trial_seeds(study, point)]
    assert len(set(seeds)) == len(seeds) == 40
    more = studies(complete(changed("studies", "table1", "trials", value=30)))["table1"]
    assert trial_seeds(more, "reflex_gain=2.0")[:20] == trial_seeds(study, "reflex_gain=2.0")


def test_targets():
    made = targets(complete(CONFIG))
    assert "results/tables/table1.csv" in made
    assert "results/figures/table1-figure3.pdf" in made
    without = complete(changed("studies", "table1", "notebook", value=None))
    assert reports(studies(without)["table1"]) == []
    assert "results/parameters/table1/reflex_gain=2.0.csv" in targets(without)


def test_recordings_need_their_folder(monkeypatch):
    example = yaml.safe_load((ROOT / "config" / "recordings.example.yaml").read_text(encoding="utf-8"))
    study = studies(complete(example))["recordings"]
    monkeypatch.delenv("ANKLELOOP_RECORDINGS", raising=False)
    with pytest.raises(ConfigError, match=r"study recordings.*ANKLELOOP_RECORDINGS.*not set.*export"):
        study.source("z_pf")
    monkeypatch.setenv("ANKLELOOP_RECORDINGS", "/somewhere")
    assert study.source("z_pf") == "/somewhere/ankle_pf.mat"
    assert study.points["z_pf"]["torque_sign"] == -1
    assert study.points["z_pf"]["position"] == "position"


def listing(tmp_path, text, **more):
    """The example with a table instead of its files."""
    example = yaml.safe_load((ROOT / "config" / "recordings.example.yaml").read_text(encoding="utf-8"))
    study = example["studies"]["recordings"]
    del study["files"], study["defaults"]
    (tmp_path / "list.csv").write_text(text, encoding="utf-8")
    study |= {"table": str(tmp_path / "list.csv"), "folder": str(tmp_path), **more}
    return example


def test_a_table_lists_recordings(tmp_path):
    text = (
        "file,subject,condition,trial,torque_sign,start,stop,drift\na.mat,S1,rest,1,-1,2,30.5,2\nb.csv,S1,rest,2,,,,\n"
    )
    study = studies(complete(listing(tmp_path, text)))["recordings"]
    assert list(study.points) == ["S1-rest-1", "S1-rest-2"]
    first, second = study.points.values()
    assert (first["torque_sign"], first["start"], first["stop"], first["drift"]) == (-1, 2, 30.5, 2)
    assert (second["torque_sign"], second["start"], second["drift"], second["position"]) == (1, None, 0, "position")
    assert [len(batch) for batch in batches(study)] == [2]
    assert existing(study.source("S1-rest-1")) == []


def test_rows_override_what_holds_for_all(tmp_path):
    text = "name,file,torque_sign\na,a.mat,\nb,b.mat,1\n"
    example = listing(tmp_path, text, defaults={"torque_sign": -1, "position": "angle"})
    example["studies"]["recordings"]["files"] = {"c": {"file": "c.mat", "position": "phi"}}
    points = studies(complete(example))["recordings"].points
    assert {name: (p["torque_sign"], p["position"]) for name, p in points.items()} == {
        "a": (-1, "angle"),
        "b": (1, "angle"),
        "c": (-1, "phi"),
    }
    with pytest.raises(ConfigError, match="'colour' was unexpected"):
        complete(listing(tmp_path, text, defaults={"colour": 1}))


def test_rows_of_one_batch_are_one_recording(tmp_path):
    text = "batch,name,file,drift\nB1,,a.mat,1\n,other,c.mat,\nB1,,b.mat,2\n"
    study = studies(complete(listing(tmp_path, text)))["recordings"]
    assert list(study.points) == ["B1", "other"]
    assert [Path(path).name for path in study.sources("B1")] == ["a.mat", "b.mat"]
    assert [part["drift"] for part in study.parts("B1")] == [1, 2]
    assert len(study.parts("other")) == 1


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("file,torque_sign\na.mat,2\n", r"line 2.*torque_sign.*2 is not one of \[1, -1\]"),
        ("file,color\na.mat,red\n", "line 2.*'color' was unexpected"),
        ("name,file\nx,a.mat\nx,b.mat\n", "line 3: the name 'x' is taken"),
        ("name,file\na/b,a.mat\n", "line 2.*does not match"),
        ("name,file\n", "has no rows"),
        ("name,subject\nx,S1\n", "line 2.*'file' is a required property"),
    ],
)
def test_tables_with_mistakes(tmp_path, text, message):
    with pytest.raises(ConfigError, match=message):
        complete(listing(tmp_path, text))


def test_a_study_of_recordings_needs_some(tmp_path):
    with pytest.raises(ConfigError, match="there is no table"):
        complete(listing(tmp_path, "file\na.mat\n", table=str(tmp_path / "other.csv")))
    with pytest.raises(ConfigError, match="name its recordings under files, or a table"):
        complete(listing(tmp_path, "file\na.mat\n", table=None))


def test_what_is_selected_must_be_an_option():
    method = {"method": "pr-moesp", "select": {"order": [1, 0]}}
    with pytest.raises(ConfigError, match=r"select → a → options → order.*0 is less than the minimum of 1"):
        complete(changed("studies", "table1", "methods", "a", value=method))
    method = {"method": "riv", "select": {"block_rows": [10]}}
    with pytest.raises(ConfigError, match="'block_rows' was unexpected"):
        complete(changed("studies", "table1", "methods", "a", value=method))
    method = complete(
        changed("studies", "table1", "methods", "a", value={"method": "riv", "select": {"order": [2, 3]}})
    )
    told = identify_options(method["studies"]["table1"]["methods"]["a"])
    assert told["select"] == {"order": [2, 3]}
    assert "order" not in told


def test_fingerprints_follow_imports(tmp_path, monkeypatch):
    import fingerprint as module

    before = {name: fingerprint(f"workflow/scripts/{name}.py") for name in ("simulate", "identify", "economy")}
    library = tmp_path / "src"
    for file in (ROOT / "src").rglob("*.py"):
        copy = library / file.relative_to(ROOT / "src")
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_bytes(file.read_bytes())
    monkeypatch.setattr(module, "LIBRARY", library)
    module._parsed.cache_clear()
    assert {name: fingerprint(f"workflow/scripts/{name}.py") for name in before} == before
    touched = library / "ankleloop" / "methods" / "parallel_cascade.py"
    touched.write_text(touched.read_text(encoding="utf-8") + "\n# changed\n", encoding="utf-8")
    after = {name: fingerprint(f"workflow/scripts/{name}.py") for name in before}
    assert {name for name in before if after[name] != before[name]} == {"identify"}
    touched = library / "ankleloop" / "signals.py"
    touched.write_text(touched.read_text(encoding="utf-8") + "\n# changed\n", encoding="utf-8")
    assert fingerprint("workflow/scripts/simulate.py") == before["simulate"]
    assert fingerprint("workflow/scripts/economy.py") != before["economy"]
    module._parsed.cache_clear()
