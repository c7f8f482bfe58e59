"""JSON schemas shared by REST and the command line; every field name carries its unit."""
