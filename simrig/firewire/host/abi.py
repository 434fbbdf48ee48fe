"""The kernel's firewire-cdev interface: the part of `<linux/firewire-cdev.h>` that libdc1394 uses.

Byte order is the machine's own. The layouts are those of 64-bit Linux, with their padding.
"""

import struct
from enum import IntEnum
from typing import Final

from simrig.firewire.camera.marlin import Rcode

KERNEL_VERSION: Final = 5  #: FW_CDEV_VERSION that a kernel since 3.4 reports
#: A file whose program has named an older version, or none, loses headers that do not fit; a newer one gets more events
#: (core-cdev.c, ioctl_create_iso_context: `client->version`, which ioctl_get_info alone sets).
DROPS_HEADERS_BELOW: Final = 5
PAGE: Final = 4096  #: the kernel keeps so many bytes of packet headers until an interrupt


class Ioctl(IntEnum):
    """Number of the request, the lowest byte of the ioctl's code."""

    GET_INFO = 0x00
    SEND_REQUEST = 0x01
    INITIATE_BUS_RESET = 0x05
    CREATE_ISO_CONTEXT = 0x08
    QUEUE_ISO = 0x09
    START_ISO = 0x0A
    STOP_ISO = 0x0B
    GET_CYCLE_TIMER = 0x0C
    ALLOCATE_ISO_RESOURCE = 0x0D
    DEALLOCATE_ISO_RESOURCE = 0x0E
    SEND_BROADCAST_REQUEST = 0x12


class Event(IntEnum):
    """Type of an event that is read from the file."""

    BUS_RESET = 0
    RESPONSE = 1
    ISO_INTERRUPT = 3
    ISO_RESOURCE_ALLOCATED = 4
    ISO_RESOURCE_DEALLOCATED = 5


# Arguments of ioctls: struct fw_cdev_...
INFO: Final = struct.Struct("=IIQQQI4x")  #: version, rom_length, rom, bus_reset, bus_reset_closure, card
REQUEST: Final = struct.Struct("=IIQQQI4x")  #: tcode, length, offset, closure, data, generation
CONTEXT: Final = struct.Struct("=IIIIQI4x")  #: type, header_size, channel, speed, closure, handle
QUEUE: Final = struct.Struct("=QQII")  #: packets, data, size, handle
START: Final = struct.Struct("=iIII")  #: cycle, sync, tags, handle
HANDLE: Final = struct.Struct("=I")
TIMER: Final = struct.Struct("=QI4x")  #: local_time in us, cycle_timer
RESOURCE: Final = struct.Struct("=QQII")  #: closure, channels, bandwidth, handle

# Events: struct fw_cdev_event_...; the first field is always the closure, the second the type.
#: ..., node, local node, bus manager, resource manager, root, generation
_BUS_RESET: Final = struct.Struct("=QIIIIIII4x")
_RESPONSE: Final = struct.Struct("=QIII")  # ..., rcode, length; data follow
_ISO_INTERRUPT: Final = struct.Struct("=QIII")  # ..., cycle, header_length; headers follow
_ISO_RESOURCE: Final = struct.Struct("=QIIii")  # ..., handle, channel, bandwidth
#: The kernel sends sizeof(struct) + data bytes, though the data begin before the padding at the struct's end.
_TAIL: Final = bytes(4)

_LOCAL_BUS = 0xFFC0


def bus_reset(closure: int, node: int, count: int, generation: int) -> bytes:
    """The event after a bus reset.

    Args:
        closure: value that the program gave for its events.
        node: physical id of the file's own node; the host has the highest id and is also the root.
        count: number of nodes on the bus.
        generation: number of this configuration of the bus.
    """
    host = _LOCAL_BUS | (count - 1)
    return _BUS_RESET.pack(closure, Event.BUS_RESET, _LOCAL_BUS | node, host, host, host, host, generation)


def response(closure: int, rcode: Rcode, data: bytes) -> bytes:
    """The event at the end of a request to a node."""
    return _RESPONSE.pack(closure, Event.RESPONSE, rcode, len(data)) + data + _TAIL


def iso_interrupt(closure: int, cycle: int, headers: bytes) -> bytes:
    """The event after packets were received up to one that asked for an interrupt."""
    return _ISO_INTERRUPT.pack(closure, Event.ISO_INTERRUPT, cycle, len(headers)) + headers + _TAIL


def iso_resource(kind: Event, closure: int, handle: int, channel: int, bandwidth: int) -> bytes:
    """The event after an allocation or its end; a negative channel is an error number."""
    return _ISO_RESOURCE.pack(closure, kind, handle, channel, bandwidth)
