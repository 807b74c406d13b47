"""Records prepared for fits, with what each has of its own, and the fitting procedure."""
