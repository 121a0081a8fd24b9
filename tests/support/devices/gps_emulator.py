"""What a satellite receiver sends, byte for byte: NMEA sentences and UBX-NAV-PVT of one moment."""

from __future__ import annotations

from typing import Any

from pyubx2 import GET, UBXMessage

from metaros.drivers.gps.splitter import nmea_frame


def nmea_epoch(
    second: int, *, latitude: float = 48.1173, longitude: float = 11.5166666, quality: int = 1, gst: bool = True
) -> bytes:
    """GGA, RMC, GST and VTG of 23 March 2026, 12:35 and that second; 41.5 km/h to 84.4 degrees."""
    time = f"1235{second:02d}.00"
    north = f"{int(latitude):02d}{(latitude % 1) * 60:08.5f},N"
    east = f"{int(longitude):03d}{(longitude % 1) * 60:08.5f},E"
    sentences = [
        f"GNGGA,{time},{north},{east},{quality},08,0.9,545.4,M,46.9,M,,",
        f"GNRMC,{time},A,{north},{east},022.4,084.4,230326,003.1,W,A",
        f"GNGST,{time},1.2,,,,0.8,0.9,1.5",
        "GNVTG,084.4,T,,M,022.4,N,41.5,K,A",
    ]
    return b"".join(nmea_frame(text) for text in sentences if gst or "GST" not in text)


def nmea_no_fix(*, time: str = "") -> bytes:
    """What a receiver in a cellar sends."""
    return nmea_frame(f"GNGGA,{time},,,,,0,00,99.99,,,,,,") + nmea_frame(f"GNRMC,{time},V,,,,,,,,,,N")


def pvt(**fields: Any) -> bytes:
    """One NAV-PVT; lengths in mm, speeds in mm/s, place in degrees."""
    values = {
        "year": 2026, "month": 3, "day": 23, "hour": 12, "min": 35, "second": 19, "validDate": 1, "validTime": 1,
        "fixType": 3, "gnssFixOk": 1, "numSV": 11, "lat": 48.1, "lon": 11.5, "height": 592300, "hMSL": 545400,
        "hAcc": 1414, "vAcc": 2500, "velN": 1000, "velE": -2000, "velD": 300,
    }  # fmt: skip
    return bytes(UBXMessage("NAV", "NAV-PVT", GET, **(values | fields)).serialize())
