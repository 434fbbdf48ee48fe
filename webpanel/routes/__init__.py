"""The calls of the REST API, one module for each chapter of its documentation."""
