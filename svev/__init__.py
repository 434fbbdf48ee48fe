"""The command line `svev`, and what only it needs: doctor, demonstration, composition of the service."""

import os

# Before numpy is loaded: our matrices are small, and idle BLAS threads spin on the cores that the frames need
# (an adjustment of 400 unknowns on two busy cores: 50 ms with one thread, 1100 ms with two).
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
