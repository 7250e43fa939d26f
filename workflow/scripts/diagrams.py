"""Figures 1 and 2: the block diagrams."""

from pathlib import Path

from ankleloop.plotting.diagrams import closed_loop_diagram, parallel_cascade_diagram
from ankleloop.plotting.style import save_figure

from job import running

with running(snakemake):
    for stem, diagram in (("figure1", parallel_cascade_diagram()), ("figure2", closed_loop_diagram())):
        save_figure(diagram, Path(snakemake.output[0]).with_name(stem), endings=(".png", ".pdf", ".svg"))
