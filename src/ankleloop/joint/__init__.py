"""The model of the joint: bases, reflex dynamics, Hammerstein path, regressors of a trial, estimate."""
