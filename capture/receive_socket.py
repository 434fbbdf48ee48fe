"""Through which kind of socket a GigE Vision camera's packets come. Knows no SDK, so that the doctor can ask, too.

A packet socket costs far less at high rates, but hands packets over in blocks, up to 5 ms late. A plain socket is the
better choice for a slow camera, if its receive buffer rides out a stall of this program.
"""

from pathlib import Path
from typing import Final

from rig.clocks import NS_PER_S
from rig.settings import NetworkSettings

SOCKET_BUFFER_BYTES: Final = 8 << 20  #: what is asked for; the kernel grants at most net.core.rmem_max
STALL_FRAMES: Final = 8  #: so many frames must fit into a plain socket's buffer
_SLOW_BYTES_PER_S: Final = 20e6


def prefers_plain_socket(network: NetworkSettings, frame_bytes: int, period_ns: int) -> bool:
    """Whether a plain socket is chosen although a packet socket may be permitted."""
    if network.packet_socket == "off":
        return True
    granted = int(Path("/proc/sys/net/core/rmem_max").read_text(encoding="ascii"))
    return frame_bytes * NS_PER_S / period_ns <= _SLOW_BYTES_PER_S and granted >= STALL_FRAMES * frame_bytes
