"""Request and response schemas that only the REST service uses."""
