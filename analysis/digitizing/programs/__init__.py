"""Long work for the operators of a log, each done by a program beside the service."""
