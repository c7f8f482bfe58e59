"""Web service: REST API and the operator's page."""
