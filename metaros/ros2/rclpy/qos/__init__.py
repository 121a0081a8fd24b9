"""Quality of service: profiles, overrides, events."""
