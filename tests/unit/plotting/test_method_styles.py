from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
import yaml

from ankleloop.plotting.style import (
    METHOD_STYLES,
    VARIANTS,
    label_styles,
    method_styles,
    ordinal_styles,
)
from ankleloop.studies.study import read_studies

ROOT = Path(__file__).parents[3]
# Machado, Oliveira and Fernandes (2009), severity 1, for linear RGB.
VISION = {
    "all receptors": np.eye(3),
    "deuteranopia": np.array(
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]]
    ),
    "protanopia": np.array(
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]
    ),
}
LEAST_DIFFERENCE = 15.0  # CIE 1976; 2.3 can just be told apart side by side


@pytest.fixture(scope="module")
def article_studies():
    """Studies of the configuration of the paper."""
    return read_studies(yaml.safe_load((ROOT / "config" / "config.yaml").read_text(encoding="utf-8")))[1]


def perceive(colour, matrix):
    """A colour in CIE L*a*b*, as an eye sees it."""
    coded = np.array([int(colour[start : start + 2], 16) for start in (1, 3, 5)]) / 255
    linear = np.where(coded <= 0.04045, coded / 12.92, ((coded + 0.055) / 1.055) ** 2.4)
    to_xyz = np.array(
        [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.072175], [0.0193339, 0.119192, 0.9503041]]
    )
    x, y, z = to_xyz @ np.clip(matrix @ linear, 0, 1) / [0.95047, 1.0, 1.08883]
    fx, fy, fz = (np.cbrt(v) if v > 216 / 24389 else (24389 / 27 * v + 16) / 116 for v in (x, y, z))
    return np.array([116 * fy - 16, 500 * (fx - fy), 200 * (fy - fz)])


@pytest.mark.parametrize("vision", VISION)
def test_colours_can_be_told_apart_by_readers_without_red_or_green_receptors(vision):
    for first, second in combinations(METHOD_STYLES.values(), 2):
        difference = np.linalg.norm(perceive(first.colour, VISION[vision]) - perceive(second.colour, VISION[vision]))
        assert difference >= LEAST_DIFFERENCE, (first, second)


@pytest.mark.parametrize("vision", VISION)
def test_ordinal_colours_go_from_dark_to_light_for_all_readers(vision):
    for count in range(2, 7):
        styles = ordinal_styles(map(str, range(count))).values()
        lightness = [perceive(style.colour, VISION[vision])[0] for style in styles]
        assert np.all(np.diff(lightness) > 3.0)


def test_variants_keep_colour_family_and_symbol_and_differ_otherwise():
    keys = [f"variant {number}" for number in range(len(VARIANTS))]
    styles = list(method_styles({**dict.fromkeys(keys, "riv"), "pi-moesp": "pi-moesp"}).values())[:-1]
    assert {style.marker for style in styles} == {METHOD_STYLES["riv"].marker}
    assert len({(style.colour, style.filled, style.dashes) for style in styles}) == len(VARIANTS)
    assert len({style.dashes for style in styles}) == len(VARIANTS)  # in grey print


def test_no_two_methods_of_a_study_look_alike(article_studies):
    for name, study in article_studies.items():
        styles = list(
            label_styles(study.labels, {name: method.method for name, method in study.methods.items()}).values()
        )
        if name != "obstacles":  # draws four of its methods
            assert len(set(styles)) == len(styles), name


def test_a_new_method_has_a_style_too():
    styles = method_styles({"mine": "mine", "riv": "riv"})
    assert styles["mine"].colour not in {style.colour for style in METHOD_STYLES.values()}
    assert styles["mine"].marker not in {style.marker for style in METHOD_STYLES.values()}


def test_many_variants_of_a_single_method_have_colours_of_their_own():
    styles = method_styles({f"form {number}": "pr-moesp" for number in range(6)}).values()
    assert len({style.colour for style in styles}) == len({style.marker for style in styles}) == 6
