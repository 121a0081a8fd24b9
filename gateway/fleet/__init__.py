"""What is asked of robots: commands, publishing, service calls, driving."""
