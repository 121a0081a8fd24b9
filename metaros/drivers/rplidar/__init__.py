"""Slamtec's RPLIDAR A1, A2, A3 and C1 on a serial line."""
