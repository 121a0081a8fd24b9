"""The domain model: frozen data and pure rules; imports no framework."""
