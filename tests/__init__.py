"""The tests of all rooms."""

import svev  # noqa: F401 - one BLAS thread, set before numpy is loaded: several only spin when tests run in parallel
