"""JSON schemas shared by REST and the command line; the name of every field carries its unit."""
