"""Request and response schemas of the REST service alone."""
