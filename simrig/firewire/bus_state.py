"""What the owner of an emulated FireWire bus may ask about it as a whole."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class BusState:
    """The state of the bus as a whole.

    Attributes:
        generation: number of its configuration; every reset makes a new one.
        bandwidth: free units in each cycle.
        channels: allocated isochronous channels.
        nodes: names of the nodes, e.g. fw0 (the computer), fw1.
    """

    generation: int
    bandwidth: int
    channels: tuple[int, ...]
    nodes: tuple[str, ...]
