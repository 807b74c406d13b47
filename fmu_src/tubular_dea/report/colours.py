"""The colours of curves, for pages too: matplotlib, which figures.py needs, takes half a second to load."""

COLOURS = ("#c8402f", "#2a6f97", "#e8a200", "#3a7d44", "#7b4f9d", "#5b6b7a")
