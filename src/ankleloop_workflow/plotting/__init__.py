"""Figures of studies and sweeps."""
