"""A sampled signal by itself: its clock, its levels, its hum and its noise."""
