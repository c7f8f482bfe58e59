"""Predicted vibration at the probes over speed, and comparison with a run."""
