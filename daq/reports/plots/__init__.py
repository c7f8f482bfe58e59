"""Plots: panels, layouts, and their renderers."""
