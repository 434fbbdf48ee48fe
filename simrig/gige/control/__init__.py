"""The control side of a simulated GigE Vision camera: control socket, commands, and their effect on the device."""
