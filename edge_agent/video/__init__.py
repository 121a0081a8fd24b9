"""Video on its way through the agent: whole groups of frames or none, key frames on demand, a bit rate that fits."""
