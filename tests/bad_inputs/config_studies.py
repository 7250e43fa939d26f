"""Simulated studies of the configuration, their settings and methods."""

from ankleloop.studies.study import Study
from bad_inputs.bad_input import BadInput
from bad_inputs.config_inputs import STUDY, config, method, row, study, text

TITLE = "Configuration: simulated studies and methods"


def _rows_of_studies() -> list[BadInput]:
    place = "config → studies → s"
    return [
        row("studies in a list", config(studies=["s"]), "config → studies: must be a mapping of keys to values"),
        row("no studies", config(studies={}), "config → studies", "must not be empty"),
        row("a study that is empty", config(studies={"s": None}), f"{place}: must be a mapping of keys to values"),
        row(
            "a study that is a text",
            config(studies={"s": "table1"}),
            f"{place}: must be a mapping of keys to values, got 'table1'",
        ),
        row("unknown key", config(studdies={}), "config: unknown key 'studdies'", "did you mean 'studies'"),
        row("unknown key of a study", study(trails=3), f"{place}: unknown key 'trails'", "did you mean 'trials'"),
        row("a name with a slash", config(studies={"../s": STUDY}), "config → studies → ../s"),
        row(
            "a name that is a number",
            config(studies={1: STUDY}),
            "config.yaml, line 2: YAML reads the key 1 as a number",
            "quotes",
        ),
        row("run names no study", config(run=["table9"]), "config: run: there is no study 'table9'; there are s"),
        row("run is a text", config(run="s"), "config → run", "list"),
        row("run is empty", config(run=[]), "config: run", "names no study"),
        row("a study run twice", config(run=["s", "s"]), "config: run", "'s'", "twice"),
        row("2.5 trials", study(trials=2.5), f"{place} → trials", "whole number", "got 2.5"),
        row("1.0 trials", study(trials=1.0), right=_has_one_trial),
        row("no trials", study(trials=0), f"{place} → trials", "got 0"),
        row("trials that are true", study(trials=True), f"{place} → trials", "whole number", "got True"),
        row("trials as text", study(trials="20"), f"{place} → trials", "whole number", "got '20'"),
        row("a seed that is missing", study(seed=None), f"{place} → seed", "got None"),
        row("a seed below 0", study(seed=-1), f"{place} → seed", "got -1"),
        row(
            "a title that is a date",
            text("title: 2024-01-01"),
            "config.yaml, line 9: YAML reads 2024-01-01 as a date",
            "quotes",
        ),
        row(
            "unknown kind",
            study(kind="simulations"),
            f"{place} → kind: must be one of 'simulation', 'recordings' (did you mean 'simulation'?)",
        ),
        row("unknown notebook", study(notebook="table9"), f"{place} → notebook: must be one of", "got 'table9'"),
        row(
            "a figure of a method that the study does not have",
            study(figure={"methods": ["b"]}),
            place,
            "figure",
            "'b'",
        ),
        row(
            "a figure of a trial that the study does not have",
            study(figure={"trial": 5}),
            place,
            "figure",
            "trial",
            "5",
        ),
        row("a figure of no method", study(figure={"methods": []}), f"{place} → figure → methods: must not be empty"),
        row(
            "a figure of a method twice",
            study(figure={"methods": ["a", "a"]}),
            f"{place}: figure: methods: 'a' is listed",
        ),
        row("a figure of length 0", study(figure={"length": 0.0}), f"{place} → figure → length [s]", "got 0.0"),
        row("run is a mapping", config(run={"s": 1}), "config → run: must be a list in brackets"),
        row("a study in run that is null", config(run=[None]), "config → run", "must be text, got None"),
        row("a seed with a fraction", study(seed=0.5), f"{place} → seed", "whole number", "got 0.5"),
        row("trials beyond all bounds", study(trials=10**9), f"{place} → trials", "between 1 and 100000"),
        row("a figure behind the end of the trial", study(figure={"start": 100.0}), place, "figure", "start", "100"),
    ]


def _rows_of_simulations() -> list[BadInput]:
    place = "config → studies → s"
    return [
        row(
            "nan as a setting",
            text("simulation: {stiffness: .nan}"),
            f"{place} → simulation → stiffness [N·m/rad]",
            "got nan",
        ),
        row(
            "infinity as a setting",
            text("simulation: {duration: .inf}"),
            f"{place} → simulation → duration [s]",
            "got inf",
        ),
        row(
            "a setting that YAML reads as text",
            text("simulation: {stiffness: 1e3}"),
            f"{place} → simulation → stiffness [N·m/rad]",
            "'1e3'",
        ),
        row(
            "a setting with a decimal comma",
            text("simulation: {duration: '50,0'}"),
            f"{place} → simulation → duration [s]",
            "'50,0'",
        ),
        row("yes as a number", text("simulation: {snr_db: yes}"), f"{place} → simulation → snr_db [dB]", "got True"),
        row(
            "unknown setting",
            study(simulation={"stifness": 1.0}),
            f"{place} → simulation: unknown key 'stifness'",
            "did you mean 'stiffness'",
        ),
        row("settings in a list", study(simulation=[1]), f"{place} → simulation: must be a mapping of keys to values"),
        row(
            "a negative duration", study(simulation={"duration": -1}), f"{place} → simulation → duration [s]", "got -1"
        ),
        row(
            "a point out of range",
            study(points={"reflex_gain": [-2.0]}),
            f"{place} → points → reflex_gain=-2.0 → reflex_gain [N·m·s/rad]",
            "got -2.0",
        ),
        row(
            "points by an unknown setting",
            study(points={"gain": [1.0]}),
            f"{place} → points: 'gain' is not a setting of the simulation",
        ),
        row(
            "points without values",
            study(points={"reflex_gain": []}),
            f"{place} → points: each setting must have a list of values",
        ),
        row(
            "a point twice",
            study(points={"reflex_gain": [13, 13.0]}),
            f"{place} → points: the point reflex_gain=13.0 is listed twice",
        ),
        row("a point that is the setting of all", study(points=[{}, {"reflex_gain": 13.0}]), "have the same settings"),
        row(
            "no list of values",
            study(points={"zeta": 1.0}),
            f"{place} → points: each setting must have a list",
            "zeta: 1.0",
        ),
        row(
            "a list as a value", study(points={"zeta": [[1.0]]}), f"{place} → points: zeta: each value must be a single"
        ),
        row("points in a text", study(points="zeta"), f"{place} → points: must be lists of values by setting"),
        row("an empty list of points", study(points=[]), f"{place} → points: must be lists of values by setting"),
        row(
            "nan as a point",
            text("points: {reflex_gain: [.nan]}"),
            "reflex_gain=nan → reflex_gain [N·m·s/rad]",
            "got nan",
        ),
        row("a number beyond all floats", study(points={"zeta": [10**400]}), f"{place} → points → zeta=1000"),
        row(
            "a misspelt setting in points",
            study(points={"reflex_gian": [1.0]}),
            "'reflex_gian' is not a setting of the simulation (did you mean 'reflex_gain'?)",
        ),
        row(
            "10,000,000,000 points",
            study(points={name: list(range(1, 101)) for name in ("zeta", "delay", "stiffness", "inertia", "omega_n")}),
            f"{place} → points: 10,000,000,000 points are more than 100,000",
        ),
        row(
            "a million chunks",
            study(points={"reflex_gain": list(range(1000))}, trials=1000, trials_per_chunk=1),
            f"{place}: 1,000,000 chunks are more than 100,000: increase trials_per_chunk",
        ),
        row(
            "parts of points",
            study(points_per_chunk=2, trials_per_chunk=2),
            f"{place}: a chunk is some points, or part",
        ),
        row("chunks of 0 points", study(points_per_chunk=0), f"{place} → points_per_chunk", "got 0"),
    ]


def _rows_of_methods() -> list[BadInput]:
    place = "config → studies → s → methods"
    return [
        row("no methods", study(methods={}), place, "must not be empty"),
        row("methods in a list", study(methods=["riv"]), f"{place}: must be a mapping of keys to values"),
        row(
            "unknown method",
            method(method="pr-moes"),
            f"{place} → a → method: must be one of 'pr-moesp'",
            "got 'pr-moes'",
        ),
        row(
            "unknown option",
            method(options={"blok_rows": 3}),
            f"{place} → a → options: unknown key 'blok_rows'",
            "did you mean 'block_rows'",
        ),
        row("an option out of range", method(options={"order": 0}), f"{place} → a → options → order", "got 0"),
        row(
            "an order as large as the block rows",
            method(options={"order": 15}),
            f"{place} → a → options",
            "block_rows must be larger than the order",
        ),
        row(
            "a rate that does not divide that of the record",
            method(options={"identification_rate": 70.0}),
            f"{place} → a",
            "70",
            "1000",
        ),
        row(
            "a candidate out of range",
            method(select={"order": [0]}),
            f"{place} → a: select: ",
            "between 1 and 20, got 0",
        ),
        row("a method that is null", study(methods={"a": None}), f"{place} → a: must be a mapping of keys to values"),
        row(
            "a method without its name",
            study(methods={"a": {"label": "x"}}),
            f"{place} → a: the key 'method' is missing",
        ),
        row("a method in a list", method(method=["riv"]), f"{place} → a → method: must be one of", "['riv']"),
        row("options in a list", method(options=[1]), f"{place} → a → options: must be a mapping of keys to values"),
        row(
            "options that are null", method(options=None), f"{place} → a → options: must be a mapping of keys to values"
        ),
        row(
            "an option that is text", method(options={"order": "2"}), f"{place} → a → options → order", "without quotes"
        ),
        row("no candidates", method(select={"order": []}), f"{place} → a → select → order: must not be empty"),
        row(
            "candidates without a list", method(select={"order": 2}), f"{place} → a → select → order: must be a list in"
        ),
        row("unknown candidates", method(select={"ordre": [2]}), f"{place} → a: select: ", "did you mean 'order'"),
        row(
            "an option that is fixed and selected",
            method(options={"order": 2}, select={"order": [2, 3]}),
            f"{place} → a: option 'order' is given, and to be selected as well",
        ),
        row(
            "a criterion without a selection",
            method(criterion="instrumental"),
            "criterion is that of a selection",
        ),
        row(
            "a reference that no simulated trial has",
            method(options={"reference": "refrence"}),
            f"{place} → a → options: a simulated trial has no 'refrence' (did you mean 'reference'?)",
        ),
        row(
            "trials that are shorter than the filters",
            study(simulation={"duration": 0.1}),
            f"{place} → a → options: the record of 0.1 s is too short",
        ),
        row(
            "leads beyond the block rows",
            method(options={"instrument_leads": 16}),
            f"{place} → a → options: instrument_leads must be between 0 and block_rows (15), got 16",
        ),
        row("a name with a space", study(methods={"a b": {"method": "riv"}}), f"{place} → a b"),
        row(
            "two methods with one label",
            study(methods={"a": {"method": "riv"}, "b": {"method": "riv", "label": "a"}}),
            "'a'",
            "label",
        ),
    ]


def _has_one_trial(studies: dict[str, Study]) -> None:
    trials = studies["s"].settings.trials
    assert (trials, type(trials)) == (1, int)


ROWS = [*_rows_of_studies(), *_rows_of_simulations(), *_rows_of_methods()]
