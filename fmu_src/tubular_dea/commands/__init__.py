"""One module for each subcommand of `tubular-dea`."""
