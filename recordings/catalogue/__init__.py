"""The runs of a data folder: catalogue, search, annotations, trash."""
