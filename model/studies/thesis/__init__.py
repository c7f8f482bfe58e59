"""Chapters 3, 5 and 6 of the thesis, recomputed."""
