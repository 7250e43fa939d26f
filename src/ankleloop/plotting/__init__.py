"""Figures: units on every axis, and the same bytes for the same data."""
