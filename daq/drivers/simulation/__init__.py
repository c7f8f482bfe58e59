"""The simulated rig: shaft, probes, tacho, wiring and card."""
