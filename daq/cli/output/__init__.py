"""Output of the commands: text that fits the terminal, progress of a run, its summary in words."""
