"""The search: rounds of forward selection, each revised, and what cannot be told apart."""
