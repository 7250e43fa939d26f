"""Exploration: a short experiment that is simulated, identified and drawn again with every change of a setting."""
