"""Wire formats of GigE Vision (GVCP, GVSP) and the UDP sockets that carry them."""
