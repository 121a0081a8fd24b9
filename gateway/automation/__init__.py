"""What happens by itself: events, the rules that they set off, and the functions that these call through a queue."""
