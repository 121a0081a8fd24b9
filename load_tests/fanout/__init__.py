"""The parts of the fan-out benchmark: servers that publish at a rate, and the client process that takes everything."""
