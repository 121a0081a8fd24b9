"""Recordings that robots cut from their black boxes: asked for, pulled over the link, kept."""
