"""Programs that host an FMU in the tests: our own C host, and one runner per importer."""
