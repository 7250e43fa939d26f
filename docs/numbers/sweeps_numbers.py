"""Pictures and numbers of docs/sweeps.md, from the studies of config/sweep.yaml."""

from functools import cache

import yaml
from blocks import ROOT, block
from PIL import Image
from runs import RESULTS, copy_figure, make, markdown_table

from ankleloop.plotting.style import save_figure
from ankleloop.replication.sweep_captions import describe_design, list_extremes
from ankleloop.replication.sweep_pictures import draw_sweep
from ankleloop.replication.sweep_study import SweepStudy
from ankleloop.studies.config_files import check_config_file
from ankleloop.studies.study import read_studies

CONFIG = "config/sweep.yaml"
SOURCES = (
    "ankleloop.replication.sweep_pictures",
    "ankleloop.simulation.simulate",
    "ankleloop.methods.riv",
    "ankleloop.methods.moesp",
    "ankleloop.assessment.scores",
    CONFIG,
)


@cache
def load_studies():
    """The studies of the configuration."""
    check_config_file(ROOT / CONFIG)
    return read_studies(yaml.safe_load((ROOT / CONFIG).read_text(encoding="utf-8")))[1]


def read_sweep_study(name, **options):
    """A study as its report shows it; options take the place of those of its configuration."""
    make(f"results/tables/{name}-trials.parquet", arguments=("--configfile", CONFIG))
    study = load_studies()[name]
    shown = study.settings.sweep.model_copy(update=options).model_dump()
    shared = study.settings.simulation.model_dump()
    path = RESULTS / "tables" / f"{name}-trials.parquet"
    return SweepStudy.read(path, study.varied, study.labels, shown, shared, study.algorithms)


def shrink_picture(name):
    """Write a picture of the documentation again with 256 colours, which makes it a third of its size."""
    path = ROOT / "docs" / name
    with Image.open(path) as picture:
        # A palette that covers all colours: one by frequency would change rare ones, such as the ends of colour bars.
        palette = {"method": Image.Quantize.MAXCOVERAGE, "kmeans": 5, "dither": Image.Dither.NONE}
        small = picture.convert("RGB").quantize(256, **palette)
    small.save(path, optimize=True)


@block("sweeps-map", SOURCES)
def write_map():
    copy_figure("sweep-sweep", "sweep-map.png", arguments=("--configfile", CONFIG))
    shrink_picture("sweep-map.png")
    sweep = read_sweep_study("sweep")
    table = list_extremes(sweep, sweep.summarise())
    return f"{describe_design(sweep)}\n\n{markdown_table(list(table.columns), table.to_numpy().tolist())}"


@block("sweeps-lines", SOURCES)
def write_lines():
    sweep = read_sweep_study("sweep", axes=["voluntary"], quantities=["vaf_reflex_true", "K_error"])
    figure, caption = draw_sweep(sweep)
    save_figure(figure, ROOT / "docs" / "sweep-lines", (".png",), overwrite=True)
    shrink_picture("sweep-lines.png")
    return f"*{caption}*"


@block("sweeps-effects", SOURCES)
def write_effects():
    copy_figure("sweep-design-sweep", "sweep-effects.png", arguments=("--configfile", CONFIG))
    shrink_picture("sweep-effects.png")
    sweep = read_sweep_study("sweep-design")
    return f"{describe_design(sweep)}\n\n*{draw_sweep(sweep)[1]}*"
