"""What else than an effect could explain a residual: noise, rounding, drift, zeros, starts, numerics."""
