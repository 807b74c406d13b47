"""tubular-dea: a tubular dielectric elastomer actuator as a co-simulation unit."""

__version__ = "0.1.0"
