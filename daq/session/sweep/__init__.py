"""Sweeps over parameters of the model, computed by local processes or a Dask cluster."""
