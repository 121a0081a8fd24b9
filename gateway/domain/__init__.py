"""What a fleet is made of, as frozen data and pure rules; imports no framework."""
