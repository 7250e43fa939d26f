from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
import yaml

from ankleloop.config.study import read_studies
from ankleloop.plotting.style import (
    METHOD_STYLES,
    label_styles,
)

ROOT = Path(__file__).parents[3]
# Machado, Oliveira and Fernandes (2009), severity 1, for linear RGB.
VISION = {
    "all receptors": np.eye(3),
    "deuteranopia": np.array(
        [
            [0.367322, 0.860646, -0.227968],
            [0.280085, 0.672501, 0.047413],
            [-0.011820, 0.042940, 0.968881],
        ]
    ),
    "protanopia": np.array(
        [
            [0.152286, 1.052583, -0.204868],
            [0.114503, 0.786281, 0.099216],
            [-0.003882, -0.048116, 1.051998],
        ]
    ),
}
LEAST_DIFFERENCE = 15.0  # CIE 1976; 2.3 can just be told apart side by side


@pytest.fixture(scope="module")
def article_studies():
    """Studies of the configuration of the paper."""
    return read_studies(
        yaml.safe_load((ROOT / "config" / "config.yaml").read_text(encoding="utf-8"))
    )[1]


def perceive(colour, matrix):
    """A colour in CIE L*a*b*, as an eye sees it."""
    coded = np.array([int(colour[start : start + 2], 16) for start in (1, 3, 5)]) / 255
    linear = np.where(coded <= 0.04045, coded / 12.92, ((coded + 0.055) / 1.055) ** 2.4)
    to_xyz = np.array(
        [
            [0.4124564, 0.3575761, 0.1804375],
            [0.2126729, 0.7151522, 0.072175],
            [0.0193339, 0.119192, 0.9503041],
        ]
    )
    x, y, z = to_xyz @ np.clip(matrix @ linear, 0, 1) / [0.95047, 1.0, 1.08883]
    fx, fy, fz = (np.cbrt(v) if v > 216 / 24389 else (24389 / 27 * v + 16) / 116 for v in (x, y, z))
    return np.array([116 * fy - 16, 500 * (fx - fy), 200 * (fy - fz)])


@pytest.mark.parametrize("vision", VISION)
def test_colours_can_be_told_apart_by_readers_without_red_or_green_receptors(vision):
    for first, second in combinations(METHOD_STYLES.values(), 2):
        difference = np.linalg.norm(
            perceive(first.colour, VISION[vision]) - perceive(second.colour, VISION[vision])
        )
        assert difference >= LEAST_DIFFERENCE, (first, second)


def test_no_two_methods_of_a_study_look_alike(article_studies):
    for name, study in article_studies.items():
        styles = list(
            label_styles(
                study.labels, {name: method.method for name, method in study.methods.items()}
            ).values()
        )
        assert len(set(styles)) == len(styles), name
