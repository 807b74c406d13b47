"""A patient from a recorded beat."""
