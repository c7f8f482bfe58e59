"""What the samples of a run say as a whole, in tables and plots: the same for the command line and for REST."""
