"""Numbers of docs/assumptions.md: what the assumptions do to the nine numbers of Table 1."""

import pandas as pd
from blocks import ROOT, block
from runs import copy_figure, markdown_table, read_study

from ankleloop.replication.captions import format_setting, label_setting

SOURCES = (
    "ankleloop.simulation.simulate",
    "ankleloop.methods.moesp",
    "ankleloop.methods.parallel_cascade",
    "ankleloop.assessment.scores",
)
TOLERANCE = 2.0  # points of VAF
GRIDS = {
    "sensitivity": ["reflex_gain", "load_stiffness", "voluntary"],
    "sensitivity-actuator": ["reflex_gain", "actuator_frequency", "actuator_damping"],
}
ONE_PASS = "parallel-cascade-one-pass"
RULES = {
    ONE_PASS: "one pass",
    "parallel-cascade-two-passes": "two passes",
    "parallel-cascade-laboratory": "laboratory's rule",
}


def read_cells(study):
    """Mean VAF of each number of Table 1 at each point and for each stop rule, beside the published one."""
    rows, varied = read_study(study), GRIDS[study]
    paper = pd.read_csv(ROOT / "data" / "published" / "table1.csv")
    cells = []
    for rule, name in RULES.items():
        for number in paper.itertuples():
            method = rule if number.method.startswith("parallel-cascade") else number.method
            means = rows[rows["method"] == method].groupby(varied)[f"vaf_{number.torque}_{number.against}"].mean()
            cells.append(
                means.rename("vaf")
                .reset_index()
                .assign(rule=name, method=number.method, torque=number.torque, paper=number.paper)
            )
    table = pd.concat(cells, ignore_index=True)
    return table.assign(deviation=(table["vaf"] - table["paper"]).abs())


def published_number(method, torque):
    """A number of Table 1 as it is published."""
    paper = pd.read_csv(ROOT / "data" / "published" / "table1.csv").set_index(["method", "torque"])["paper"]
    return float(paper[method, torque])


def summarise(cells, varied):
    """Largest deviation and count of numbers within the tolerance, for each cell of a map."""
    within = cells.assign(within=cells["deviation"] <= TOLERANCE)
    groups = within.groupby([*varied, "rule"], sort=False)
    return groups.agg(worst=("deviation", "max"), within=("within", "sum"), numbers=("within", "size")).reset_index()


def describe(row, varied):
    return ", ".join(f"{label_setting(name)[0]} {format_setting(name, row[name])}" for name in varied)


@block("assumptions-grids", SOURCES, studies=tuple(GRIDS))
def write_grids():
    lines = []
    for study, varied in GRIDS.items():
        grid = summarise(read_cells(study), varied)
        complete = int((grid["within"] == grid["numbers"]).sum())
        nearest = grid.sort_values(["within", "worst"], ascending=[False, True]).iloc[0]
        lines.append(
            f"- `{study}`, over {', '.join(label_setting(name)[0] for name in varied)} and the stop rule: "
            f"**{complete} of {len(grid)} cells have all nine numbers within ±{TOLERANCE:g} points.** The nearest "
            f"({describe(nearest, varied)}, {nearest['rule']}) has {nearest['within']} of {nearest['numbers']}, the "
            f"worst of them {nearest['worst']:.1f} points off; the smallest worst deviation of any cell is "
            f"{grid['worst'].min():.1f} points."
        )
    copy_figure("sensitivity-map", "assumptions.png")
    return "\n".join(lines)


@block("assumptions-rules", SOURCES, studies=tuple(GRIDS))
def write_rules():
    grid = summarise(read_cells("sensitivity"), GRIDS["sensitivity"])
    best = grid.pivot_table("worst", "rule", "reflex_gain", "min", sort=False)
    header = ["stop rule", *(f"gain {gain:g}" for gain in best.columns)]
    return markdown_table(
        header, [[rule, *(f"{value:.1f}" for value in values)] for rule, *values in best.itertuples()]
    )


@block("assumptions-numbers", SOURCES, studies=("sensitivity",))
def write_numbers():
    cells = read_cells("sensitivity")
    cells = cells[cells["rule"] == RULES[ONE_PASS]]
    rows = []
    for (method, torque), part in cells.groupby(["method", "torque"], sort=False):
        nearest = part.loc[part["deviation"].idxmin()]
        extent = f"{part['vaf'].min():.1f} … {part['vaf'].max():.1f}"
        share = 100 * (part["deviation"] <= TOLERANCE).mean()
        rows.append([method, torque, f"{nearest['paper']:g}", f"{nearest['vaf']:.1f}", extent, f"{share:.0f}"])
    return markdown_table(
        ["method", "torque", "paper [%]", "nearest [%]", "range over the grid [%]", "cells within ±2 [%]"], rows
    )


@block("assumptions-contradictions", SOURCES, studies=("sensitivity",))
def write_contradictions():
    cells = read_cells("sensitivity")
    cells = cells[cells["rule"] == RULES[ONE_PASS]]
    table = cells.pivot_table("vaf", GRIDS["sensitivity"], ["method", "torque"])
    cascade = published_number(ONE_PASS, "intrinsic")
    near = (table[ONE_PASS]["intrinsic"] - cascade).abs() <= TOLERANCE
    if not near.any():
        return f"In no cell one pass of the parallel cascade has the published intrinsic VAF ({cascade:g} %)."
    texts = []
    for method, torque in ((ONE_PASS, "net"), ("eiv-moesp", "intrinsic")):
        values = table[method][torque][near]
        number = published_number(method, torque)
        texts.append(
            f"the {torque} VAF of `{method}` is {values.min():.1f} to {values.max():.1f} % (published: {number:g} %)"
        )
    return (
        f"In the {int(near.sum())} of {len(table)} cells in which one pass of the parallel cascade has the published "
        f"intrinsic VAF ({cascade:g} ± {TOLERANCE:g} %), {' and '.join(texts)}."
    )
