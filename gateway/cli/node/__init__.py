"""What a gateway adds to `metaros node`: nodes of remote robots."""
