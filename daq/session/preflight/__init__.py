"""Preflight checks of the rig, and measurements for calibrations."""
