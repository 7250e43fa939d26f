"""Tables and the picture of the benchmarks."""

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
    "vaf": "VAF, fresh [%]",
    "failed": "failed",
}
COLOURS = {
    "ankleloop": "#0b5394",
    "ctrlsys": "#b45f06",
    "ctrlsys, IB01BD": "#e69138",
    "sippy_unipi": "#6aa84f",
    "nfoursid": "#a64d79",
    "floor": "0.55",
}
MARKERS = {"ankleloop": "o", "ctrlsys": "s", "ctrlsys, IB01BD": "v", "sippy_unipi": "^", "nfoursid": "D", "floor": "_"}
ALONG = {"samples": "samples", "inputs": "inputs", "block rows": "rows"}


def _text(value, places):
    return "" if pd.isna(value) else f"{value:,.{places}f}"


def markdown(table):
    """The table in words and numbers."""
    places = {"ms": 2, "ratio": 2, "mib": 0, "vaf": 3}
    shown = table[[name for name in COLUMNS if name in table]].copy()
    for name, count in places.items():
        shown[name] = shown[name].map(lambda value, count=count: _text(value, count))
    shown["pole_error"] = shown["pole_error"].map(lambda value: "" if pd.isna(value) else f"{value:.1e}")
    shown["failed"] = shown["failed"].fillna("")
    lines = [[COLUMNS[name] for name in shown], ["---"] * shown.shape[1], *shown.astype(str).values.tolist()]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines) + "\n"


def picture(times, path):
    """Times against samples, inputs and block rows."""
    figure, axes = plt.subplots(1, 3, figsize=(12, 4.2), sharey=True, layout="constrained")
    for axis, (along, column) in zip(axes, ALONG.items(), strict=True):
        part = times[times["along"] == along]
        for name, rows in part.groupby("program", sort=False):
            style = {"color": COLOURS[name], "marker": MARKERS[name], "linestyle": ":" if name == "floor" else "-"}
            axis.plot(rows[column], rows["ms"], label=name, **style)
        axis.set(xscale="log", yscale="log", xlabel=along)
        axis.set_xticks(sorted(part[column].unique()), [f"{value:,}" for value in sorted(part[column].unique())])
        axis.minorticks_off()
        axis.grid(alpha=0.3)
    axes[0].set_ylabel("time of an identification [ms]")
    axes[0].legend(frameon=False)
    figure.suptitle("Open-loop data, one thread; where nothing else is said 5,000 samples, 8 inputs, 15 block rows")
    figure.savefig(path, dpi=150)
    plt.close(figure)


def report(table, times, folder):
    """Write everything, and print the table."""
    folder.mkdir(parents=True, exist_ok=True)
    table.to_csv(folder / "peers.csv", index=False)
    times.to_csv(folder / "peers-times.csv", index=False)
    (folder / "peers.md").write_text(markdown(table), encoding="utf-8")
    picture(times, folder / "peers.png")
    print(markdown(table))
    print(f"Written to {folder}")
