"""From the configuration to studies, points, methods and the files that each of them makes."""

import csv
import itertools
import os
import sys
import zlib
from copy import deepcopy
from dataclasses import dataclass
from pathlib import Path

import yaml

SCHEMA = Path(__file__).parent / "schemas" / "config.schema.yaml"

# Figures that each notebook makes of a study, besides its report and its table.
FIGURES = {
    "table1": lambda study: ["figure3", "order"],
    "figure4": lambda study: ["figure4", "passes"],
    "passes": lambda study: ["passes"],
    "table2": lambda study: ["figure5"],
    "comparison": lambda study: ["stiffness", "vaf"],
    "traces": lambda study: ["traces"],
    "sensitivity": lambda study: ["map"],
    "efficiency": lambda study: ["efficiency", "intervals"],
    "choosing": lambda study: ["choosing"],
    "recordings": lambda study: ["group"],
}
ARTICLE = {
    "report": "results/article.html",
    "verification": "results/verification.csv",
    "page": "results/verification.md",
    "economy": "results/tables/economy.csv",
}
TOGETHER = 8  # recordings of one job
DIAGRAMS = [f"results/figures/figure{number}{end}" for number in (1, 2) for end in (".png", ".pdf", ".svg")]


class ConfigError(ValueError):
    """A configuration that does not keep the schema: the message names the key."""


@dataclass(frozen=True)
class Study:
    """One study: what it reads, its points, its methods."""

    name: str
    settings: dict

    @property
    def kind(self):
        """Kind of the study, simulation or recordings."""
        return self.settings["kind"]

    @property
    def notebook(self):
        """Notebook that renders the study, or None."""
        return self.settings["notebook"]

    @property
    def against(self):
        """What estimates are scored against: "measured", or None for the truths where there are any."""
        return self.settings.get("against")

    @property
    def methods(self):
        """Methods by label in paths."""
        return self.settings["methods"]

    @property
    def varied(self):
        """Names of the parameters that differ between the points."""
        return list(dict.fromkeys(name for chosen in self.combinations.values() for name in chosen))

    @property
    def points(self):
        """Parameters of each point, or the mapping of each recording, by name."""
        if self.kind == "recordings":
            return {**self.settings["files"], **self.listed["first"]}
        return {point: {**self.settings["simulation"], **chosen} for point, chosen in self.combinations.items()}

    @property
    def listed(self):
        """Recordings that a table lists, by name; once read they are settings."""
        return self.settings.get("rows", {"first": {}, "more": {}})

    @property
    def combinations(self):
        """Values of the varied parameters at each point; recordings vary none."""
        if self.kind == "recordings":
            return {point: {} for point in self.points}
        given = self.settings["points"]
        if isinstance(given, dict):
            products = itertools.product(*given.values())
            given = [dict(zip(given, values, strict=True)) for values in products]
        return {point_name(chosen): chosen for chosen in given}

    @property
    def labels(self):
        """Legend of each method."""
        return {name: method["label"] or name for name, method in self.methods.items()}

    @property
    def jobs(self):
        """Points of a simulation that share a job; one more at the end changes the last job alone."""
        points, count = list(self.points), self.settings["together"]
        return [points[first : first + count] for first in range(0, len(points), count)]

    def folder(self):
        """Folder of the recordings."""
        folder = os.path.expandvars(self.settings["folder"])
        if "$" in folder:
            raise ConfigError(
                f"study {self.name}: the folder of its recordings is {self.settings['folder']}, but that environment "
                "variable is not set. Set it to the folder that holds them, for example: "
                "export ANKLELOOP_RECORDINGS=/folder/of/your/recordings"
            )
        return Path(folder)

    def source(self, point):
        """Path of the first file of a recording."""
        return self.sources(point)[0]

    def sources(self, point):
        """Paths of all files of a recording."""
        return [str(self.folder() / part["file"]) for part in self.parts(point)]

    def parts(self, point):
        """Mappings of all files of a recording: one, or those of the trials that are merged."""
        return [self.points[point], *self.listed.get("more", {}).get(point, ())]


def read_rows(name, settings, schema):
    """Rows of the table of a study of recordings, each checked; raises ConfigError naming table and line."""
    path = Path(os.path.expandvars(settings["table"]))
    if not path.exists():
        raise ConfigError(f"study {name}: there is no table {path}.")
    with path.open(newline="", encoding="utf-8-sig") as file:
        rows = list(csv.DictReader(file))
    first, more = {}, {}
    for line, row in enumerate(rows, start=2):
        given = {key.strip(): _cell(value) for key, value in row.items() if key and (value or "").strip()}
        given = {**settings["defaults"], **given}
        of = [str(given.get(key)) for key in ("subject", "condition", "trial") if key in given]
        merged, called = given.pop("batch", None), given.pop("name", None)
        point = str(merged or called or "-".join(of) or Path(str(given.get("file", line))).name)
        _check({point: given}, {**schema["$defs"]["recordings"], "$defs": schema["$defs"]}, (f"{path}, line {line}",))
        if merged and point in first:
            more.setdefault(point, []).append(given)
            continue
        if point in first:
            raise ConfigError(f"{path}, line {line}: the name {point!r} is taken; give each row a name of its own.")
        first[point] = given
    if not first:
        raise ConfigError(f"study {name}: the table {path} has no rows.")
    return {"first": first, "more": more}


def _cell(text):
    """A cell of a table: a whole number, a number, or text."""
    text = text.strip()
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text


def existing(path):
    """A file as an input if it is there: one that is missing is refused by its own job, and stops no other."""
    return [path] if Path(path).exists() else []


def point_name(chosen):
    """Name of a point in paths, from the parameters that make it, whatever their order."""
    return ",".join(f"{name}={value}" for name, value in sorted(chosen.items())) or "only"


def trial_seeds(study, point):
    """Entropy of every trial of a point, so that any part of a study can be rerun alone and give the same bits."""
    key = [study.settings["seed"], zlib.crc32(study.name.encode()), zlib.crc32(point.encode())]
    return [[*key, trial] for trial in range(study.settings["trials"])]


def complete(config):
    """Check a configuration against the schema and fill in its defaults.

    Returns a new mapping; raises ConfigError naming the key that is wrong.
    """
    schema = yaml.safe_load(SCHEMA.read_text(encoding="utf-8"))
    config = deepcopy(config)
    _apply_defaults(config)
    _check(config, schema)
    for name, settings in config["studies"].items():
        if settings["kind"] == "recordings":
            _list_recordings(name, settings, schema)
        else:
            for point, parameters in Study(name, settings).points.items():
                _check(dict(parameters), {**schema["$defs"]["simulation"], "$defs": schema["$defs"]}, ("points", point))
        _check_selections(name, settings, schema)
    for key in ("run", "article"):
        unknown = set(config.get(key, ())) - set(config["studies"])
        if unknown:
            raise ConfigError(
                f"config: {key}: there is no study {sorted(unknown)[0]!r}; there are {sorted(config['studies'])}."
            )
    return config


def _apply_defaults(config):
    """What a study of recordings says of all of them, where a recording does not say otherwise."""
    for settings in config.get("studies", {}).values():
        if isinstance(settings, dict) and isinstance(settings.get("defaults"), dict):
            files = settings.get("files") or {}
            settings["files"] = {name: {**settings["defaults"], **given} for name, given in files.items()}


def _list_recordings(name, settings, schema):
    """Read the table of a study of recordings, if it has one."""
    if settings["table"]:
        settings["rows"] = read_rows(name, settings, schema)
    if not Study(name, settings).points:
        raise ConfigError(f"study {name}: name its recordings under files, or a table that lists them.")


def _check_selections(name, settings, schema):
    """Every candidate that a method is to select from has to be an option that it can have."""
    for method, given in settings["methods"].items():
        for option, values in given["select"].items():
            for value in values:
                alone = {"method": given["method"], "options": {option: value}}
                where = ("studies", name, "methods", method, "select")
                _check({method: alone}, {**schema["$defs"]["methods"], "$defs": schema["$defs"]}, where)


def studies(config):
    """All studies of a complete configuration by name."""
    return {name: Study(name, settings) for name, settings in config["studies"].items()}


def chosen(config):
    """The studies that are to be made."""
    everything = studies(config)
    return [everything[name] for name in config.get("run", everything)]


def reports(study):
    """Files that the notebook of a study makes."""
    if study.notebook is None:
        return []
    names = FIGURES[study.notebook](study)
    figures = [f"results/figures/{study.name}-{name}{end}" for name in names for end in (".png", ".pdf")]
    tables = [f"results/tables/{study.name}{end}" for end in (".csv", ".md")]
    return [f"results/reports/{study.name}.html", *tables, *figures]


def scores(study, folder="scores"):
    """Score or parameter tables of a study, a file for each point."""
    return [f"results/{folder}/{study.name}/{point}.csv" for point in study.points]


def simulated(studies):
    """The studies that are simulated."""
    return [study for study in studies.values() if study.kind == "simulation"]


def rule_name(step, study, number):
    """Name of the rule that makes a step for the points of one job."""
    return f"{step}_{study.name.replace('-', '_')}_{number}"


def trials(study, point):
    """Trials of a point."""
    return f"results/trials/{study.name}/{point}.nc"


def estimates(study, point):
    """Estimates of a point, a file for each method."""
    return [f"results/estimates/{study.name}/{point}/{method}.nc" for method in study.methods]


def without_selected(method):
    """A method whose options to be selected have no defaults."""
    return {**method, "options": {k: value for k, value in method["options"].items() if k not in method["select"]}}


def identify_options(method):
    """Everything that `ankleloop.identify` is told of a method."""
    chosen = {name: method[name] for name in ("select", "criterion")} if method["select"] else {}
    return without_selected(method)["options"] | chosen


def page(study, point):
    """Page of a recording."""
    return f"results/reports/{study.name}/{point}.html"


def batches(study):
    """Recordings that share a job; none of a study that is simulated."""
    if study.kind != "recordings":
        return []
    points = list(study.points)
    return [points[first : first + TOGETHER] for first in range(0, len(points), TOGETHER)]


def notebook_parameters(study):
    """Parameters of the notebook of a study; every notebook takes the same. Recordings have tables and no scores."""
    if study.kind == "recordings":
        return {
            **_shared_parameters(study),
            "scores": [],
            "parameters": scores(study, "parameters"),
            "trials": {},
            "estimates": {},
        }
    return {
        **_shared_parameters(study),
        "scores": scores(study),
        "parameters": scores(study, "parameters"),
        "trials": {point: trials(study, point) for point in study.points},
        "estimates": {point: dict(zip(study.methods, estimates(study, point), strict=True)) for point in study.points},
    }


def _shared_parameters(study):
    return {
        "study": study.name,
        "kind": study.kind,
        "title": study.settings["title"],
        "labels": study.labels,
        "points": study.points,
        "varied": study.varied,
        "figure": study.settings["figure"],
        "published": "data/published",
        "table_stem": f"results/tables/{study.name}",
        "figure_stem": f"results/figures/{study.name}",
    }


def notebook_inputs(study):
    """Files that the notebook of a study reads."""
    given = notebook_parameters(study)
    found = [path for methods in given["estimates"].values() for path in methods.values()]
    return [*given["scores"], *given["parameters"], *given["trials"].values(), *found]


def article_studies(config):
    """Studies that the ledger and the article are made of; none where one of them is not run."""
    made = {study.name: study for study in chosen(config)}
    names = config["article"]
    return [made[name] for name in names] if set(names) <= set(made) else []


def article_parameters(config):
    """Parameters of the notebook of the article."""
    return {
        "title": "Closed-loop identification of ankle dynamics: a replication",
        "studies": {
            study.name: {
                "title": study.settings["title"],
                "trials": study.settings["trials"],
                "parameters": study.settings["simulation"],
                "varied": study.varied,
                "methods": study.labels,
                "scores": scores(study),
                "estimates": scores(study, "parameters"),
                "table": f"results/tables/{study.name}.csv",
                "report": f"results/reports/{study.name}.html",
                "figures": [f"results/figures/{study.name}-{name}.png" for name in FIGURES[study.notebook](study)],
            }
            for study in article_studies(config)
        },
        "verification": ARTICLE["verification"],
        "economy": ARTICLE["economy"],
        "diagrams": [path for path in DIAGRAMS if path.endswith(".png")],
    }


def targets(config):
    """Everything that the chosen studies make."""
    made = []
    for study in chosen(config):
        if study.kind == "recordings":
            # Here, and not only in the rule that reads: results of an earlier run would hide a folder that is not set.
            study.folder()
            made += [page(study, point) for point in study.points]
            made += reports(study) or scores(study, "parameters")
            continue
        made += reports(study) or [*scores(study), *scores(study, "parameters")]
    return [*made, *DIAGRAMS, *ARTICLE.values()] if article_studies(config) else made


def _jsonschema():
    """Without its grammar of IRIs, which takes two seconds to compile: no schema here has one."""
    sys.modules.setdefault("rfc3987_syntax", None)
    import jsonschema

    return jsonschema


def _check(config, schema, where=()):
    jsonschema = _jsonschema()
    validator = _with_defaults(jsonschema.Draft202012Validator)(schema)
    error = jsonschema.exceptions.best_match(validator.iter_errors(config), key=lambda e: -len(e.absolute_path))
    if error is None:
        return
    key = " → ".join(str(part) for part in ("config", *where, *error.absolute_path))
    known = error.schema.get("properties") if error.validator == "additionalProperties" else None
    hint = f"; known here: {', '.join(known)}" if known else ""
    unit = f" [{error.schema['unit']}]" if isinstance(error.schema, dict) and "unit" in error.schema else ""
    raise ConfigError(f"{key}{unit}: {error.message}{hint}.")


def _with_defaults(validator_class):
    """Validator that fills in defaults as it goes, each a copy of its own."""
    check = validator_class.VALIDATORS["properties"]

    def fill(validator, properties, instance, schema):
        if isinstance(instance, dict):
            for name, subschema in properties.items():
                if "default" in subschema:
                    instance.setdefault(name, deepcopy(subschema["default"]))
        yield from check(validator, properties, instance, schema)

    return _jsonschema().validators.extend(validator_class, {"properties": fill})
