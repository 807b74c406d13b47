"""The public functions of `tubular_dea`, one file a purpose: arguments in, results with tables and pictures out.

The command line is made of the same functions; what they do is done in the rooms before this one.
"""
