"""The seam between panel and service: what the panel may call, and the errors by which the service refuses."""
