"""Components below 1X: search in order spectra, tracks through a record, and findings of a run."""
