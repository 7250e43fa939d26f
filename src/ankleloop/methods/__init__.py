"""Identification methods: a trial in, an estimate out, all with one signature."""
