"""From recorded inputs to what drives the model: switching instants, levels, slopes."""
