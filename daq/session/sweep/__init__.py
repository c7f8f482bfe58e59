"""Sweeps over the model's parameters: many points, in processes of this machine or on a Dask cluster."""
