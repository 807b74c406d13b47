"""Candidates and their scores: which parameters, which channel, how large by chance, how small to be seen."""
