"""Studies: from the configuration to points, chunks and files."""
