"""Import from and export to files of other programs, one module a format."""
