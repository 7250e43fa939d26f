"""Jobs of a simulated study, run one after the other in this process as the rules of the workflow run them."""

from types import SimpleNamespace

from ankleloop.jobs.identification import identify_trials, read_trials
from ankleloop.jobs.simulation import simulate_trials
from ankleloop.tables.trial_tables import join_tables
from ankleloop.trials.trial_files import save_trials


def write_trials(path, study, seed, conditions, precision="double"):
    """Trial file of some conditions."""
    trials = simulate_trials(study, seed, conditions)
    index = [
        (name, number)
        for name, part in conditions.items()
        for number in range(part["first"], part["stop"])
    ]
    save_trials((trial for _, _, trial in trials), path, index, precision, overwrite=True)


def run_jobs(study, folder):
    """Run all jobs of a study; the paths of its table, its estimates and its trial files."""
    settings = study.settings
    folder.mkdir(parents=True, exist_ok=True)
    trial_files = [folder / f"trials-{number}.nc" for number in range(len(study.trial_files))]
    for path, parts in zip(trial_files, study.trial_files, strict=True):
        write_trials(path, study.name, precision=settings.precision, **study.simulation(parts))
    estimates, scores = [], []
    for chunk in range(len(study.chunks)):
        arguments = study.identification(chunk)
        simulation = arguments.pop("simulation")
        if not simulation:
            trials = read_trials(trial_files[study.file_numbers[chunk]], arguments["conditions"])
        else:
            trials = simulate_trials(study.name, precision=settings.precision, **simulation)
        files = {"scores": folder / f"scores-{chunk}.parquet"}
        if settings.keep != "scores":
            files["estimates"] = folder / f"estimates-{chunk}.parquet"
            estimates.append(str(files["estimates"]))
        identify_trials(trials, files, study.name, **arguments)
        scores.append(files["scores"])
    table = folder / f"{study.name}-trials.parquet"
    join_tables(table, scores, study.rows, table.with_suffix(".csv"))
    return SimpleNamespace(table=table, scores=scores, estimates=estimates, trials=trial_files)
