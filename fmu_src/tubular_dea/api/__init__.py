"""The public functions of `tubular_dea`, one file per purpose: arguments in, results with tables and pictures out.

The command line uses the same functions. They are a thin layer over the other folders of the package.
"""
