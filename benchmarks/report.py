"""Tables and the figure of the benchmarks."""

import matplotlib
import pandas as pd
import tools

from ankleloop.plotting.panels import add_legend, panel_grid
from ankleloop.plotting.style import STYLE, MethodStyle, save_figure

COLUMNS = {
    "data": "data",
    "program": "program",
    "ms": "median [ms]",
    "over_ankleloop_median": "over ankleloop",
    "interval": "quartiles",
    "rounds": "rounds",
    "mib": "peak [MiB]",
    "pole_error": "error of a pole",
    "vaf": "VAF, validation [%]",
    "failure": "failure",
}
FORMATS = {
    "ms": "{:,.2f}",
    "over_ankleloop_median": "{:,.2f}",
    "rounds": "{:.0f}",
    "mib": "{:,.0f}",
    "vaf": "{:,.3f}",
    "pole_error": "{:.0e}",
}
LEAST_ROUNDS = 4  # that have quartiles
CASE = ["kind", "samples", "block_rows", "channels"]
# Colours that readers without red or green receptors can tell apart; no two programs share a symbol.
STYLES = {
    "ankleloop": MethodStyle("#0072B2", "o"),
    "ctrlsys": MethodStyle("#D55E00", "s"),
    "ctrlsys, IB01BD": MethodStyle("#E69F00", "v"),
    "sippy_unipi": MethodStyle("#009E73", "^"),
    "nfoursid": MethodStyle("#882255", "D"),
    "kernels": MethodStyle("#888888", "", dashes=(1.0, 1.5)),
}
AXES = {"samples": "samples", "inputs": "channels", "block rows": "block_rows"}  # column of each label


def describe_case(case):
    """A data set in words, as the columns `CASE` have it."""
    channels = f", {case.channels} × {case.channels}" if case.kind not in ("open loop", "paper") else ""
    return f"{case.kind}{channels}, {case.samples:,} samples, {case.block_rows} block rows"


def format_table(table):
    """Times, ratios and accuracy of all programs as a Markdown table."""
    table = table.copy()
    table["data"] = [describe_case(case) for case in table.itertuples()]
    table["data"] = table["data"].where(~table.duplicated(CASE), "")
    table["interval"] = [
        f"{low:,.2f} … {high:,.2f}" if rounds >= LEAST_ROUNDS else ""
        for low, high, rounds in zip(
            table["over_ankleloop_low"], table["over_ankleloop_high"], table["rounds"], strict=True
        )
    ]
    cells = table[list(COLUMNS)].astype(object)
    for name, text in FORMATS.items():
        cells[name] = [text.format(value) if pd.notna(value) else "" for value in cells[name]]
    cells["failure"] = cells["failure"].fillna("")
    return tools.format_table(cells.rename(columns=COLUMNS).to_dict("records")) + "\n"


def describe_ratios(table):
    """Time of ankleloop over that of `ctrlsys` for each data set, as a Markdown list."""
    rows = table[(table["program"] == "ankleloop") & table["over_ctrlsys_median"].notna()]
    return "\n".join(
        f"- {describe_case(row)}: **{row.over_ctrlsys_median:.2f}** "
        f"({row.over_ctrlsys_low:.2f} … {row.over_ctrlsys_high:.2f})"
        for row in rows.itertuples()
    )


@matplotlib.rc_context(STYLE)
def plot_times(times):
    """Plot the median times against samples, inputs and block rows; the table beside the picture has them."""
    figure, axes = panel_grid(len(AXES), len(AXES), 62.0, sharey=True)
    for axis, (label, column) in zip(axes, AXES.items(), strict=True):
        points = times[times["variable"] == label]
        for name, rows in points.groupby("program", sort=False):
            axis.plot(rows[column], rows["ms"], **STYLES[name].curve, label=name)
        axis.set(xscale="log", yscale="log", xlabel=label)
        ticks = sorted(points[column].unique())
        axis.set_xticks(ticks, [f"{value:,}" for value in ticks], rotation=30 if len(ticks) > 5 else 0)
        axis.xaxis.minorticks_off()
        axis.yaxis.set_major_formatter("{x:g}")
    axes[0].set_ylabel("processor time [ms]")
    figure.suptitle("Open-loop data, one thread; 5,000 samples, 8 inputs, 15 block rows except where they vary")
    add_legend(figure)
    return figure


def write_report(table, times, folder):
    """Write tables and figure to a folder, and print the table."""
    folder.mkdir(parents=True, exist_ok=True)
    table.to_csv(folder / "peers.csv", index=False)
    times.to_csv(folder / "peers-times.csv", index=False)
    (folder / "peers.md").write_text(format_table(table), encoding="utf-8")
    save_figure(plot_times(times), folder / "peers", (".png",), overwrite=True)
    print(format_table(table), describe_ratios(table), f"Written to {folder}", sep="\n")
