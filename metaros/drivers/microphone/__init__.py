"""Microphones: sound as PCM or Opus packets of 20 ms."""
