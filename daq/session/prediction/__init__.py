"""The model's prediction beside a run: map cache, predictor, refinement at the exact speed."""
