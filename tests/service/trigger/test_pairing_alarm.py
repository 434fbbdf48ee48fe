"""An alarm of the pairing on the page."""

from rig.api.statement import Level
from rig.phrase import phrase
from service.status.statements import pairing_alarm


def test_an_alarm_is_a_statement_with_advice() -> None:
    said = phrase("pairing_rate", "pulses come at {measured} Hz: correct [trigger] rate_hz", measured=101.0)
    stated = pairing_alarm(said)
    assert (stated.level, stated.code) == (Level.WARNING, "pairing_rate")
    assert (stated.text, stated.advice) == ("pulses come at 101.0 Hz", "correct [trigger] rate_hz")
    assert stated.values == {"measured": 101.0}
