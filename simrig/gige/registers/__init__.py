"""The registers of a simulated GigE Vision camera, and their GenICam description."""
