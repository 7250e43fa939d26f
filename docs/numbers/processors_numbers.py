"""Numbers of docs/reliability.md: how far results of other kinds of processor differ."""

from blocks import Unavailable, block
from processors import LIMIT, POINTS, TORQUES, TRIALS, compare, run_kinds
from runs import markdown_table

SOURCES = (
    "benchmarks/processors.py",
    "ankleloop.simulation.simulate",
    "ankleloop.methods.moesp",
    "ankleloop.methods.parallel_cascade",
    "ankleloop.methods.real_time",
    "ankleloop.methods.riv",
)


@block("processors", SOURCES)
def write_processors():
    """Largest relative differences of each method over all kinds of processor."""
    results = run_kinds()
    if len(results) < 2:
        raise Unavailable("OpenBLAS has kernels for no other kind of processor here")
    differences = compare(results)
    columns = [name for name in next(iter(differences.values())) if name != "count"]
    rows = [[name, *(f"{row[column]:.0e}" for column in columns)] for name, row in differences.items()]
    changed = sum(row["count"] for row in differences.values())
    runs = len(results) - 1
    largest = max(row[column] for row in differences.values() for column in columns)
    text = (
        f"Kernels for {', '.join(results)}; {TRIALS} trials of 30 s at each of {len(POINTS)} points. Differences are "
        "the largest ones from the first kind, relative to the parameter or to the standard deviation of the "
        f"torque. The largest of all is {largest:.0e}; the promise is {LIMIT:.0e}. Another number of passes or "
        f"iterations: in {changed} of {runs * TRIALS * len(POINTS) * len(differences)} identifications."
    )
    header = ["method", *(f"{column} torque" if column in TORQUES else column for column in columns)]
    return f"{text}\n\n{markdown_table(header, rows)}"
