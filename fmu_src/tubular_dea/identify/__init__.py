"""Identification: recordings, their noise, and the parameters of a model that fit them best."""
