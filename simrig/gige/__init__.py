"""A GigE Vision camera in software: control protocol (GVCP), stream protocol (GVSP) and the sensor behind them."""
