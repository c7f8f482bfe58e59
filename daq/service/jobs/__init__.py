"""Long work in processes of its own: job queue and what its jobs do."""
