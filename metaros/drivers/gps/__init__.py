"""GPS and other satellite receivers that speak NMEA or u-blox UBX on a serial line."""
