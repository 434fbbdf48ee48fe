"""Every test runs under the watch of `tests.support.plugin`."""

from tests.support.plugin import (
    _nothing_left_behind,
    loopback,
    pytest_addoption,
    pytest_collection,
    pytest_collection_finish,
    pytest_collection_modifyitems,
    pytest_configure,
    pytest_runtest_makereport,
    run_token,
    short_path,
)
from tests.support.reliability import fault_table

__all__ = [
    "_nothing_left_behind",
    "fault_table",
    "loopback",
    "pytest_addoption",
    "pytest_collection",
    "pytest_collection_finish",
    "pytest_collection_modifyitems",
    "pytest_configure",
    "pytest_runtest_makereport",
    "run_token",
    "short_path",
]
