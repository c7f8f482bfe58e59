"""Predicted vibration at the probes over speed, and its comparison with a run."""
