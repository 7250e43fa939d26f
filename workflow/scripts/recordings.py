"""Recordings from files to pages: check, every valid method, export. A bad one is refused, and no failure."""

import base64
import html
import io
import sys
from pathlib import Path

import pandas as pd

from ankleloop.errors import DataError
from ankleloop.plotting.recordings import model_figure, residual_figure, spectra_figure
from ankleloop.plotting.style import torque_figure
from ankleloop.recordings.analysis import Analysis, analyse
from ankleloop.recordings.checks import Check, Finding
from ankleloop.recordings.export import export_estimate
from ankleloop.records.drift import remove_drift
from ankleloop.records.files import whole_file
from ankleloop.records.readers import read_trial
from ankleloop.records.trial import segment

from job import log, progress, running

READING = ("position", "torque", "reference", "sampling_rate", "position_unit", "position_sign", "torque_sign")
SHOWN = {
    "vaf_unseen": "net VAF, unseen half [%]",
    "vaf_net": "net VAF [%]",
    "vaf_intrinsic": "intrinsic contribution [%]",
    "vaf_reflex": "reflex contribution [%]",
    "K": "K [N·m/rad]",
    "B": "B [N·m·s/rad]",
    "I": "I [kg·m²]",
    "G": "G [N·m·s/rad]",
    "omega_n": "ωn [rad/s]",
    "zeta": "ζ [1]",
    "threshold": "threshold [rad/s]",
    "delay": "delay [s]",
    "selected": "selected",
}


def prepared(path, given):
    """The trial, or the part of it that is asked for, without its drift."""
    if not Path(path).exists():
        raise DataError(f"there is no file {Path(path).name} in the folder of the recordings.")
    trial = read_trial(path, **{name: given[name] for name in READING})
    if given["start"] is not None or given["stop"] is not None:
        stop = given["stop"] if given["stop"] is not None else float(trial["time"][-1]) + 1.0
        trial = segment(trial, given["start"] or 0.0, stop)
    return remove_drift(trial, given["drift"]) if given["drift"] else trial


def analysed(name, given, methods):
    """The first trial and the analysis of all; of a file that cannot be used, its reason."""
    try:
        trials = [prepared(path, part) for path, part in zip(given["paths"], given["parts"], strict=True)]
        return trials[0], analyse(trials, methods)
    except DataError as error:
        log.info("refused: %s", error)
        print(f"{name} refused: {error}", file=sys.stderr)
        check = Check([Finding("file", "refused", str(error))], "undecided", {})
        return None, Analysis(check, {}, {}, pd.DataFrame([{"verdict": "refused", "reasons": str(error)}]))


def picture(figure):
    """A figure inside the page, in the size in which its letters can be read."""
    width = min(960, round(100 * figure.get_size_inches()[0]))
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=150, metadata={"Software": None})
    return f'<img width="{width}" src="data:image/png;base64,{base64.b64encode(stream.getvalue()).decode()}">'


def cell(row, name):
    """A value with its interval, as a reader wants it."""
    value, low, high = row.get(name), row.get(f"{name}_low"), row.get(f"{name}_high")
    if isinstance(value, str) or pd.isna(value):
        return value if isinstance(value, str) else "–"
    interval = "" if pd.isna(low) else f" ({low:.4g} … {high:.4g})"
    return f"{value:.4g}{interval}"


def valid_rows(table):
    """Methods that were fitted; none of a recording that was refused."""
    return table[table["valid"].astype(bool)] if "valid" in table else table.iloc[:0]


def methods_table(table):
    """Methods side by side, one column each."""
    columns = {row["label"]: [cell(row, name) for name in SHOWN] for _, row in valid_rows(table).iterrows()}
    shown = pd.DataFrame(columns, index=list(SHOWN.values()))
    return shown[~shown.isin(["–", ""]).all(axis=1)].to_html(border=0)


def decision(analysis):
    """What to take, in one sentence."""
    valid = valid_rows(analysis.table)
    if valid.empty:
        return "Nothing can be concluded from this recording."
    if analysis.check.loop == "closed":
        name = "riv" if "riv" in set(valid["method"]) else valid["method"].iloc[0]
        chosen = valid[valid["method"] == name].iloc[0]
        why = "the loop is closed, and torque that is fed back does not bias it"
    else:
        chosen = valid.loc[valid["vaf_unseen"].idxmax()]
        why = f"it explains most of the half that was not fitted ({chosen['vaf_unseen']:.1f} %)"
    condition = "" if analysis.check.loop != "undecided" else " If the loop was open:"
    return f"{condition} take {chosen['label']}: {why}. K = {cell(chosen, 'K')} N·m/rad.".strip()


def body(name, given, trial, analysis, window):
    """The page from top to bottom."""
    who = [f"{key} {given[key]}" for key in ("subject", "condition", "trial") if given[key] not in (None, "")]
    parts = [
        f"<h1>{html.escape(name)}</h1>",
        f"<p>{html.escape(', '.join([*who, *('file ' + part['file'] for part in given['parts'])]))}</p>",
    ]
    parts.append(f"<p><b>{analysis.check.verdict}.</b> {html.escape(decision(analysis))}</p><h2>Check</h2>")
    found = [[f.name, f.verdict, f.text] for f in analysis.check.findings]
    parts.append(pd.DataFrame(found, columns=["what", "verdict", "finding"]).to_html(index=False, border=0))
    if analysis.check.spectra:
        parts.append(picture(spectra_figure(analysis.check.spectra)))
    if analysis.estimates:
        drawn = torque_figure(
            trial.drop_vars([v for v in trial if v.startswith("torque_")]), analysis.estimates, **window
        )
        parts += ["<h2>Methods</h2>", methods_table(analysis.table), said(analysis.table)]
        parts += ["<p>In brackets: 95 % intervals. Contributions are against the measured net torque.</p>"]
        parts += ["<h2>Torques</h2>", picture(drawn), "<h2>Models</h2>", picture(model_figure(analysis.estimates))]
        parts += ["<h2>Residuals</h2>", picture(residual_figure(analysis.residuals)), tests(analysis.residuals)]
    else:
        parts.append(said(analysis.table))
    return "\n".join(parts)


def said(table):
    """Warnings, and why a method was left out."""
    if "warnings" not in table:
        return ""
    rows = table[table["warnings"].fillna("") != ""]
    lines = [f"<li><b>{html.escape(row.label)}:</b> {html.escape(row.warnings)}</li>" for row in rows.itertuples()]
    return f"<ul>{''.join(lines)}</ul>" if lines else ""


def tests(residuals):
    """The tests in words."""
    lines = [
        f"<li><b>{html.escape(label)}:</b> the residual is {'' if test.white else 'not '}white in the pass band "
        f"(p = {test.white_p:.2g}), and {'depends' if test.related else 'does not depend'} on the movement "
        f"(p = {test.related_p:.2g}).</li>"
        for label, test in residuals.items()
    ]
    return f"<ul>{''.join(lines)}</ul>"


def finish(name, given, page, table_path, folder):
    """Everything that is kept of one recording."""
    trial, analysis = analysed(name, given, methods)
    log.info("%s: %s\n%s", name, analysis.check.verdict, analysis.check)
    told = {"recording": name, **{key: given[key] for key in ("subject", "condition", "trial")}}
    table = analysis.table.assign(**told, key=analysis.table.get("label", pd.Series(dtype=object)).map(keys))
    with whole_file(table_path) as path:
        table[[*told, *[column for column in table if column not in told]]].to_csv(path, index=False)
    Path(folder).mkdir(parents=True, exist_ok=True)
    for label, estimates in analysis.records.items():
        for number, estimate in enumerate(estimates, start=1):
            stem = keys[label] if len(estimates) == 1 else f"{keys[label]}-{number}"
            for suffix in (".nc", ".mat", ".csv"):
                export_estimate(estimate, Path(folder) / f"{stem}{suffix}")
    window = {key: snakemake.params.figure[key] for key in ("start", "length")}
    content = style.replace("{{ title }}", html.escape(name))
    with whole_file(page) as path:
        path.write_text(content.replace("{{ body }}", body(name, given, trial, analysis, window)), encoding="utf-8")


with running(snakemake):
    methods = {method["label"] or key: method for key, method in snakemake.params.methods.items()}
    keys = {method["label"] or key: key for key, method in snakemake.params.methods.items()}
    style = Path(snakemake.input.style).read_text(encoding="utf-8")
    outputs = zip(snakemake.output.pages, snakemake.output.tables, snakemake.output.estimates, strict=True)
    for (name, given), made in zip(snakemake.params.points.items(), progress(list(outputs), "made"), strict=True):
        finish(name, given, *made)
