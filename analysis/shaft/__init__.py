"""Orbit, centreline, Poincaré section and overall vibration of the shaft."""
