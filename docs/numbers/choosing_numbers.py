"""Numbers of docs/choosing.md and docs/explanation/net-vaf.md: net VAF and truth, bias of a polynomial basis."""

from blocks import block
from runs import copy_figure, markdown_table, mean, read_study

from ankleloop.replication.captions import label_setting

SOURCES = (
    "ankleloop.simulation.simulate",
    "ankleloop.methods.riv",
    "ankleloop.methods.moesp",
    "ankleloop.methods.selection",
    "ankleloop.assessment.scores",
)
COLUMNS = {
    "vaf_net_measured": ("net VAF [%]", ".1f"),
    "unseen_cross_validation": ("net VAF, unseen halves [%]", ".1f"),
    "unseen_instrumental": ("instrumental VAF, unseen halves [%]", ".1f"),
    "vaf_intrinsic_true": ("true intrinsic VAF [%]", ".1f"),
    "vaf_reflex_true": ("true reflex VAF [%]", ".1f"),
    "K": ("K [N·m/rad]", ".1f"),
}


@block("choosing-study", SOURCES, studies=("choosing",))
def write_study():
    table = read_study("choosing")
    copy_figure("choosing-choosing", "choosing.png")
    strongest = table[table["voluntary"] == table["voluntary"].max()]
    rows = [
        [heading, *(mean(part[column], spec) for _, part in strongest.groupby("method", sort=False))]
        for column, (heading, spec) in COLUMNS.items()
    ]
    methods = [f"`{method}`" for method, _ in strongest.groupby("method", sort=False)]
    level = 100 * table["voluntary"].max()
    trials = strongest.groupby("method").size().max()
    return (
        f"At a {label_setting('voluntary')[0]} of {level:g} % (means of {trials} trials with half of their 95 % "
        f"intervals):\n\n{markdown_table(['', *methods], rows)}"
    )


@block("choosing-polynomial", ("ankleloop.simulation.simulate", "ankleloop.methods.riv"), studies=("efficiency",))
def write_polynomial():
    table = read_study("efficiency")
    polynomial = table[table["method"] == "riv-chebyshev"]
    truths = {"G": "reflex_gain", "zeta": "zeta"}
    errors = {}
    for name, setting in truths.items():
        values = polynomial.groupby("point", sort=False)[name].mean()
        true = polynomial.groupby("point", sort=False)[setting].first() if setting in polynomial else 1.0
        errors[name] = 100 * (values / true - 1)
    return (
        f"With a Chebyshev basis of degree 5 in `riv`, the mean error of G is {errors['G'].min():+.0f} to "
        f"{errors['G'].max():+.0f} % and that of ζ {errors['zeta'].min():+.0f} to {errors['zeta'].max():+.0f} % in the "
        f"{len(errors['G'])} settings of the study `efficiency`: a polynomial only approximates a rectifier."
    )
