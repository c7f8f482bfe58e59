"""Live analysis of sample blocks, run summary, alarms and delivery of the samples."""
