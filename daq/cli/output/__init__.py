"""Output of the commands: terminal width and encoding, progress, and summaries as text."""
