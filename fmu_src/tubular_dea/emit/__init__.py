"""From a model to text: C, Python, XML, tables. Nothing else."""
