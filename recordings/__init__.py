"""Recorded runs: the MCAP format, its writer and reader, and the catalogue of a data folder."""
