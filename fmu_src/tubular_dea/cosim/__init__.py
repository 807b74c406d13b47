"""Co-simulation: slaves, couplings as data, and the master that steps them."""
