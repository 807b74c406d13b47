"""Write the FMUs to build/. `python build_fmu.py --platforms all` makes them for every platform."""

import sys

from tubular_dea.cli import main

if __name__ == "__main__":
    sys.exit(main(["build", *sys.argv[1:]]))
