"""Speakers: streams, live speech (talk), spoken texts and files, mixed by priority."""
