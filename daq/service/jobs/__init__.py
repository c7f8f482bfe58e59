"""Job queue and the jobs that run in worker processes."""
