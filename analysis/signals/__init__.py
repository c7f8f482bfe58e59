"""Data types that all packages share: run header, sample blocks, snapshots, probes, uncertainty, errors."""
