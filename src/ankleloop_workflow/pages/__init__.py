"""Pages of studies and of the whole run."""
