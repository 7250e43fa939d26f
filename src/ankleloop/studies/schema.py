"""The JSON schema of the configuration, for editors and for reference.

``python -m ankleloop.studies.schema`` writes it, in the root of the repository.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from ankleloop.studies.config import Config

PATH = Path("workflow/schemas/config.schema.json")


def schema_text() -> str:
    """The JSON schema of the configuration: every key with its description, unit, default and bounds."""
    schema = _tidy(Config.model_json_schema())
    header = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": "ankleloop configuration"}
    return json.dumps({**header, **schema}, indent=2, ensure_ascii=False) + "\n"


def _tidy(schema: Any) -> Any:
    """The schema without titles that repeat the names of keys, and with the first sentence of each docstring."""
    if isinstance(schema, list):
        return [_tidy(part) for part in schema]
    if not isinstance(schema, dict):
        return schema
    tidy = {key: _tidy(value) for key, value in schema.items() if not (key == "title" and isinstance(value, str))}
    if tidy.get("type") == "object" and isinstance(tidy.get("description"), str):
        tidy["description"] = tidy["description"].partition("\n\n")[0].replace("\n", " ")
    return tidy


if __name__ == "__main__":
    PATH.write_text(schema_text(), encoding="utf-8")
