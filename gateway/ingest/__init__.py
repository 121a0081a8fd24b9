"""Robots' links: sessions, and what is known about every robot."""
