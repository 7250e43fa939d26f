"""Simulation of a joint that pushes against a compliant load: settings, excitation, filters, loop, trials."""
