"""Plots of results as SVG, PNG and PDF: panels, layouts, figures, renderer."""
