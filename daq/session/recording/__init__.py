"""A run being recorded: recorder process, shared-memory ring, statistics, health."""
