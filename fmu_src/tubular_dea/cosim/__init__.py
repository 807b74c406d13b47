"""Slaves, couplings as data, and the master that steps them."""
