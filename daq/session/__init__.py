"""Runs: the recorder process, live analysis, replay, import, preflight checks, predictions and sweeps."""
