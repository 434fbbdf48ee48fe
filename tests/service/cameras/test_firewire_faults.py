"""Every fault of FireWire cameras is reported with its cause, mixes up no pulses, and is documented as it happens."""

from pathlib import Path

import pytest

from tests.service.cameras.firewire_matrix import committed, rows

pytestmark = pytest.mark.long


def test_each_fault_comes_to_what_the_documentation_says(tmp_path: Path) -> None:
    documented = {fault: (tags, events) for fault, tags, events in committed()}
    found = list(rows(tmp_path))
    assert [row.fault for row in found] == list(documented), "the table has these rows, in this order"
    for row in found:
        tags, events = documented[row.fault]
        assert row.mixed == 0, row
        assert row.tags == tags, row
        # Which words come first depends on which call meets the fault first; the cause must be named in both.
        assert row.cause in row.events, row
        assert row.cause in events, row
