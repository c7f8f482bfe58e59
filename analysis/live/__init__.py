"""Live analysis of sample blocks, run summary and alarms."""
