"""The imaging side of a simulated GigE Vision camera: clock, sensor, frame memory, transmitter."""
