"""Results and analyses of recorded runs as tables, plots and text, for REST, the command line and reports."""
