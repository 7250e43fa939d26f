"""Tables and the figure of the benchmarks."""

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import pandas as pd

COLUMNS = {
    "data": "data",
    "samples": "samples",
    "block_rows": "block rows",
    "program": "program",
    "ms": "median [ms]",
    "ratio": "over ankleloop",
    "mib": "peak [MiB]",
    "pole_error": "error of a pole",
    "vaf": "VAF, validation [%]",
    "failure": "failure",
}
FORMATS = {"ms": "{:,.2f}", "ratio": "{:,.2f}", "mib": "{:,.0f}", "vaf": "{:,.3f}", "pole_error": "{:.1e}"}
COLOURS = {
    "ankleloop": "#0b5394",
    "ctrlsys": "#b45f06",
    "ctrlsys, IB01BD": "#e69138",
    "sippy_unipi": "#6aa84f",
    "nfoursid": "#a64d79",
    "kernels": "0.55",
}
MARKERS = {
    "ankleloop": "o",
    "ctrlsys": "s",
    "ctrlsys, IB01BD": "v",
    "sippy_unipi": "^",
    "nfoursid": "D",
    "kernels": "_",
}
AXES = {"samples": "samples", "inputs": "inputs", "block rows": "block_rows"}  # column of each label


def format_table(table):
    """The table as Markdown."""
    cells = table[[name for name in COLUMNS if name in table]].astype(object)
    for name, text in FORMATS.items():
        if name in cells:
            cells[name] = [text.format(value) if pd.notna(value) else "" for value in cells[name]]
    cells["failure"] = cells["failure"].fillna("")
    lines = [[COLUMNS[name] for name in cells], ["---"] * cells.shape[1], *cells.astype(str).values.tolist()]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines) + "\n"


def plot_times(times, path):
    """Plot the times against samples, inputs and block rows."""
    figure, axes = plt.subplots(1, 3, figsize=(12, 4.2), sharey=True, layout="constrained")
    for axis, (label, column) in zip(axes, AXES.items(), strict=True):
        points = times[times["variable"] == label]
        for name, rows in points.groupby("program", sort=False):
            linestyle = ":" if name == "kernels" else "-"
            axis.plot(
                rows[column], rows["ms"], label=name, color=COLOURS[name], marker=MARKERS[name], linestyle=linestyle
            )
        axis.set(xscale="log", yscale="log", xlabel=label)
        ticks = sorted(points[column].unique())
        axis.set_xticks(ticks, [f"{value:,}" for value in ticks])
        axis.minorticks_off()
        axis.grid(alpha=0.3)
    axes[0].set_ylabel("time of an identification [ms]")
    axes[0].legend(frameon=False)
    figure.suptitle("Open-loop data, one thread; 5,000 samples, 8 inputs, 15 block rows except where they vary")
    figure.savefig(path, dpi=150)
    plt.close(figure)


def write_report(table, times, folder):
    """Write tables and figure to a folder, and print the table."""
    folder.mkdir(parents=True, exist_ok=True)
    table.to_csv(folder / "peers.csv", index=False)
    times.to_csv(folder / "peers-times.csv", index=False)
    (folder / "peers.md").write_text(format_table(table), encoding="utf-8")
    plot_times(times, folder / "peers.png")
    print(format_table(table))
    print(f"Written to {folder}")
