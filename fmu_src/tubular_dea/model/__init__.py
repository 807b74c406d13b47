"""The models: physics, declared once."""
