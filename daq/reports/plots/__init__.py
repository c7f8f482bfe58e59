"""Plots of results as SVG and PNG: panels, layouts, renderers."""
