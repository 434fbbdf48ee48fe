"""A simulated GigE Vision camera: control protocol (GVCP), stream protocol (GVSP) and the sensor behind them."""
