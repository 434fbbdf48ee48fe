"""The bus process: `python -m simrig.firewire`.

Spoken to like the process of a simulated GigE Vision camera (`simrig.camera_program`), with these commands:

    {"command": "inject", "fault": {...}}    -> {}
    {"command": "unplug", "camera": "K1"}    -> {}; likewise plug, freeze, thaw
    {"command": "reset_bus"}                 -> {}
    {"command": "statistics"}                -> {"statistics": {"K1": {...}, ...}}
    {"command": "state"}                     -> {"state": {...}} of the bus
    {"command": "stop"}                      -> {}, and the process ends
"""

import sys

from rig.rigfile import validate
from simrig.camera_program import run
from simrig.firewire.config import BusConfig
from simrig.firewire.program import BusProgram

if __name__ == "__main__":
    sys.exit(run(lambda data: BusProgram(validate(BusConfig, data, "bus process"))))
