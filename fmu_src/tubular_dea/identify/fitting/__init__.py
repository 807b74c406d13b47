"""Least squares over all records: what is simulated, the likelihood, the optimum and its intervals."""
