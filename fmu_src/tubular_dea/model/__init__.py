"""The physics, declared once."""
