"""The configuration: from YAML to studies, points and chunks, and what is refused."""
