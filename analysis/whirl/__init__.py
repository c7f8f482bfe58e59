"""Components below 1X: search, tracks through a record, findings of a run."""
