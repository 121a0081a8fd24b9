"""Rules: which happenings set off what."""
