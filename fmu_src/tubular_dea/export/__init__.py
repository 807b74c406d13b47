"""From text to artefacts: libraries for every platform, FMUs, archives."""
