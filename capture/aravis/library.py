"""Loads Aravis, which PyGObject offers to Python; where it is missing, importing this says what to install."""

from rig.errors import BadInputError

try:
    import gi

    gi.require_version("Aravis", "0.8")
    from gi.repository import Aravis, GLib
except (ImportError, ValueError) as error:
    raise BadInputError(
        f"GigE Vision cameras need Aravis, which cannot be loaded ({error}): run sudo apt-get install "
        "gir1.2-aravis-0.8 python3-gi, and make Svev's environment with --system-site-packages, or install "
        "svev[gige] into it"
    ) from None

# Aravis looks for GigE Vision cameras only: looking on USB too opens sockets and timers for the life of the process.
for _interface in ("USB3Vision", "Fake"):
    Aravis.disable_interface(_interface)

__all__ = ["Aravis", "GLib"]
