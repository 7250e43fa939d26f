from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
import yaml
from matplotlib.colors import to_rgb

from ankleloop.plotting.style import (
    METHOD_STYLES,
    label_styles,
)
from ankleloop_workflow.config.study import read_studies

ROOT = Path(__file__).parents[4]
# Machado, Oliveira and Fernandes (2009), severity 1, for linear RGB: an eye without receptors for green.
DEUTERANOPIA = [
    [0.367322, 0.860646, -0.227968],
    [0.280085, 0.672501, 0.047413],
    [-0.011820, 0.042940, 0.968881],
]
LEAST_DIFFERENCE = 0.18  # of colours, from 0 to 1


@pytest.fixture(scope="module")
def article_studies():
    """Studies of the configuration of the paper."""
    return read_studies(
        yaml.safe_load((ROOT / "config" / "config.yaml").read_text(encoding="utf-8"))
    )[1]


def perceive(colour):
    """A colour as an eye without receptors for green sees it."""
    linear = np.array(to_rgb(colour)) ** 2.2
    return np.clip(DEUTERANOPIA @ linear, 0.0, 1.0) ** (1 / 2.2)


def test_colours_can_be_told_apart_by_readers_without_receptors_for_green():
    colours = [perceive(style.colour) for style in METHOD_STYLES.values()]
    for first, second in combinations(colours, 2):
        assert np.linalg.norm(first - second) >= LEAST_DIFFERENCE


def test_no_two_methods_of_a_study_look_alike(article_studies):
    for name, study in article_studies.items():
        styles = list(
            label_styles(
                study.labels, {name: method.method for name, method in study.methods.items()}
            ).values()
        )
        assert len(set(styles)) == len(styles), name
