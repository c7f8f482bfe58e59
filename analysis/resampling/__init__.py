"""Decimation, interpolation, records sampled uniformly in shaft angle, and the synchronous average."""
