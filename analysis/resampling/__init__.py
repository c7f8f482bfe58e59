"""Decimation, interpolation, records sampled uniformly in shaft angle, synchronous average."""
