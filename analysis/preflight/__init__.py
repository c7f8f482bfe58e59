"""Checks of wiring, probes, tacho and counter before a run; fit of a probe's calibration."""
