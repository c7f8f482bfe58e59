"""Export of runs to other file formats, and import of samples from them."""
