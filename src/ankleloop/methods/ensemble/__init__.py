"""Ensembles of short windows around perturbations, in closed loop."""
