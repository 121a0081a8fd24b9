"""The nouns that the agent adds to the command `metaros`."""
