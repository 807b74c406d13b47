"""Control of the tube: the best pulse for a patient, and a controller for radii at which the tube is unstable."""
