"""What the notebook of a study compares with its trials is predicted by a job before it."""

from pathlib import Path

import pandas as pd
import yaml

BEYOND = Path(__file__).parents[2] / "config" / "beyond.yaml"
TABLE = "results/tables/efficiency-predictions.parquet"
KINDS = ["known delay", "unknown delay", "reference alone"]


def test_points_are_predicted_with_each_seed(clean, snakemake, tmp_path):
    study = {"points": [{"reflex_gain": 2.0, "voluntary": 0.1}]}
    config = {"run": ["efficiency"], "article": [], "studies": {"efficiency": study}}
    path = tmp_path / "config.yaml"
    path.write_text(yaml.safe_dump(config), encoding="utf-8")
    arguments = ("--directory", str(tmp_path), "--configfile", str(BEYOND), str(path))
    snakemake(clean, TABLE, *arguments)
    table = pd.read_parquet(tmp_path / TABLE)
    assert table["kind"].value_counts().to_dict() == dict.fromkeys(KINDS, 5)
