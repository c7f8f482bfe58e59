"""Shared data types: run header, sample blocks, snapshot, probes, uncertainty, errors."""
