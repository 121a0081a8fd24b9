"""The fleet's certificate authority, and enrolment of robots."""
