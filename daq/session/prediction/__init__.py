"""Predictions for a run: the map cache, the predictor, and the refiner for the exact speed."""
