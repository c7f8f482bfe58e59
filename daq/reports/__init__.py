"""Analyses of a recorded run as table, plot and text."""
