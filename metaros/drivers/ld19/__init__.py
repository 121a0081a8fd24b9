"""LD06 and LD19: small lidars that send packets on a serial line by themselves."""
