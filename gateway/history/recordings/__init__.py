"""Recordings that robots clip from their black boxes: requested, uploaded over the link, stored."""
