"""Recorded runs: MCAP writer and reader, verification and recovery, run catalogue, import and export."""
