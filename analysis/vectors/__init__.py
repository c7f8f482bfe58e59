"""Amplitude and phase of orders: order tracks, Bode data, Vold-Kalman envelopes, run-out, glitches."""
