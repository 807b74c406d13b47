"""Sweeps: one plan, thousands to millions of rows, on a laptop or a cluster.

A plan (`plan.py`) names a model, its inputs over time, what varies and what is wanted. A row of a sweep is a pure
function of plan and row number (`rows.py`), so it does not matter where, when or how often it is computed.
"""
