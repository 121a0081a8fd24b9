"""A fleet that speaks the real link: thousands of robots in one process."""
