"""Estimates during the recording, from a window that slides."""
