"""Chooses the kind of socket that receives a GigE Vision camera's packets. Needs no Aravis: the doctor asks it too.

A packet socket costs far less at high rates, but hands packets over in blocks, up to 5 ms late. A plain socket is the
better choice for a slow camera, if its receive buffer is large enough for a stall of this program.
"""

from pathlib import Path
from typing import Final

from rig.clocks import NS_PER_S
from rig.settings.model import NetworkSettings

SOCKET_BUFFER_BYTES: Final = 8 << 20  #: asked for; the kernel grants at most net.core.rmem_max
STALL_FRAMES: Final = 8  #: a plain socket's buffer must hold this many frames
_SLOW_BYTES_PER_S: Final = 20e6


def prefers_plain_socket(network: NetworkSettings, frame_bytes: int, period_ns: int) -> bool:
    """Whether to use a plain socket although a packet socket may be permitted."""
    if network.packet_socket == "off":
        return True
    granted = int(Path("/proc/sys/net/core/rmem_max").read_text(encoding="ascii"))
    return frame_bytes * NS_PER_S / period_ns <= _SLOW_BYTES_PER_S and granted >= STALL_FRAMES * frame_bytes
