"""The front door: command line, composition of the running system, process table."""

import os

# Before numpy is loaded: our matrices are small, and idle BLAS threads spin on the cores that the frames need
# (an adjustment of 400 unknowns on two busy cores: 50 ms with one thread, 1100 ms with two).
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
