"""Rotor on linear supports: modes, Campbell diagram, critical speeds, response."""
