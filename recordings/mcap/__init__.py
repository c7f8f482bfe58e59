"""Run files in MCAP: layout, writer, reader, header, messages, and reading of damaged files."""
