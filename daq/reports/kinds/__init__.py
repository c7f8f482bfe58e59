"""Analyses of a recorded run, one module per topic; `daq.reports.registry` lists them."""
