"""Exploration: a short experiment that is simulated, identified and drawn anew with every change of a setting."""
