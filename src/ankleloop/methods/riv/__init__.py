"""Refined instrumental variables: equations between spectra, their solution, intervals, and what a model lacks."""
