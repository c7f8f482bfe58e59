"""Orbits, shaft centreline, Poincaré sections and overall vibration."""
