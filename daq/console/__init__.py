"""The operator's web page: static files."""
