"""Speakers: streams, speech from afar, spoken texts and files, mixed by priority."""
