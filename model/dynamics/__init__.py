"""Nonlinear motion of the rotor in time; synchronous motion and its stability."""
