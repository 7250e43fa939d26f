"""Experiments before they are recorded: a perturbation that suits the joint, and how long to record."""
