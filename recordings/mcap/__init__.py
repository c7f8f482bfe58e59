"""Recordings as MCAP files: writer, reader, header, results."""
