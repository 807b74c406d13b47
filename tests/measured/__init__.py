"""Plants that others built and measured, through the same engine: `python -m measured.table` from tests/."""
