"""The kinds of analysis of a recorded run."""
