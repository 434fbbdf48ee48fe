"""Commands about logs: what one holds, whole logs out of broken ones, pictures and tables, publication."""
