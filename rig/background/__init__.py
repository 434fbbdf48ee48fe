"""Programs that do long work beside the service, with the processor time that nobody else wants."""
