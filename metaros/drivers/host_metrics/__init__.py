"""This host's CPU, memory, disk, temperature and network."""
