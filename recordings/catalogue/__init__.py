"""The catalogue of a data folder: index database, search, annotations, incoming runs, trash."""
