"""The model of the joint: basis, reflex dynamics, Hammerstein path, regressors of a trial, estimate."""
