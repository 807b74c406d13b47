"""Recordings of a bench, and the parameters of a model that explain them best."""
