"""Everything live: drivers, session, view, service and command line."""
