"""Sound outputs of this machine."""

from __future__ import annotations

from collections.abc import Sequence

from metaros.drivers.probing import Found

__all__ = ["find"]


def find() -> Sequence[Found]:
    """Every output that PortAudio lists; none where the system's library is not there."""
    try:
        import sounddevice
    except OSError:
        return ()
    devices = [dict(device) for device in sounddevice.query_devices()]
    return [
        Found(kind="speaker", summary=str(device["name"]), parameters={"device": str(number)})
        for number, device in enumerate(devices)
        if device["max_output_channels"] > 0
    ]
