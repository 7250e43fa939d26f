"""Refined instrumental variables with splines of K, B and G, for joints that change in time."""
