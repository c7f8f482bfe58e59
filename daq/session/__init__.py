"""One run, live: the recorder process, the ring of blocks between processes, the live analysis."""
