"""Amplitude and phase of orders: tracks, speed curves, Vold-Kalman envelopes, run-out, glitches."""
