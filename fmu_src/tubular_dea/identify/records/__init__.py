"""Recordings: a folder of files, read, checked and in SI units, with what each starts from."""
