"""Recording a run: the recorder process, the shared-memory ring and statistics, and the run that controls them."""
