"""Measurement algorithms for a rotor with two displacement probes and a tacho: pure functions on arrays."""
