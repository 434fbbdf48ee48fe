"""What the service costs: answers of the REST API, memory and processor time over hours."""
