"""Rules: which events set off what."""
