"""Aravis's own search for cameras on the network. The only module of the doctor that needs Aravis."""

import gi

gi.require_version("Aravis", "0.8")
from gi.repository import Aravis  # noqa: E402  (the version must be required first)


def discover() -> list[str]:
    """GigE Vision cameras that answer a broadcast within a second: address, vendor, model, serial number."""
    Aravis.disable_interface("USB3Vision")
    Aravis.disable_interface("Fake")
    Aravis.update_device_list()
    found = [
        f"{Aravis.get_device_address(i)} {Aravis.get_device_vendor(i)} {Aravis.get_device_model(i)} "
        f"serial {Aravis.get_device_serial_nbr(i)}"
        for i in range(Aravis.get_n_devices())
    ]
    Aravis.shutdown()
    return found
