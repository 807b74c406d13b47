"""The options of every command that reads recordings: DATA, --columns, --dry-run, and the help on files."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path

import tubular_dea as td

from ..errors import UserError
from ..identify.records import bench_file
from ..model.declare import nearest

FORMATS = f"""files:
  Text with any delimiter (comma, semicolon, tab, spaces), decimal point or comma, encoding, and lines above or in
  between that are no numbers; headings such as 'pressure [mbar]', 'time (s)', 'radius_um' or units in a row of their
  own; times in s, ms, hh:mm:ss.fff or ISO 8601. MATLAB (.mat), HDF5, TDMS and Parquet after
  pip install '.[files]'. A column `trigger` gives switching instants, `current` is a second output.
  --dry-run shows how the files are understood.

{(bench_file.__doc__ or "").replace("::", "")}"""


def add_recordings(parser: argparse.ArgumentParser) -> None:
    """Declare DATA, --out, --columns and --dry-run."""
    parser.add_argument("data", type=Path, metavar="DATA", help="folder of recordings, one experiment a file")
    parser.add_argument("--out", type=Path, default=None, help="folder to write to (needed unless with --dry-run)")
    parser.add_argument(
        "--columns",
        nargs="+",
        default=[],
        metavar="SIGNAL=COLUMN",
        help="columns by heading or number, with a unit where the file has none or reads a factor of it, as in "
        "radius=laser_2[um] voltage=3 radius=diameter[0.5 mm]",
    )
    parser.add_argument(
        "--dry-run",
        action="store_true",
        help="only show how the files are understood, and draw them (recordings.png in --out)",
    )


def recordings_of(
    options: argparse.Namespace, begin: Callable[[td.RecordingSet], None] = lambda read: None
) -> td.RecordingSet | None:
    """The recordings in DATA; says which columns were not used, and which scale may be wrong.

    With --dry-run it shows how the files are understood, draws them if there is a folder to write to, and returns None.
    Otherwise it calls `begin` as soon as the files are read.
    """
    if options.out is None and not options.dry_run:
        raise UserError("--out is missing: expected a folder to write to, or --dry-run")
    if options.out is not None and Path(options.out).resolve() == Path(options.data).resolve():
        raise UserError(f"--out {options.out}: that is the folder of the recordings; expected another one")
    recordings = td.read_recordings(options.data, options.plant, columns=options.columns)
    known = [e.name for e in recordings.experiments]
    for name in getattr(options, "hold_out", None) or ():
        if name not in known:
            raise UserError(f"--hold-out {name}: there is no experiment {name!r}{nearest(name, known)}")
    if not options.dry_run:
        begin(recordings)
    for line in [*([] if options.dry_run else recordings.remarks()), *recordings.findings()]:
        print(line)
    if not options.dry_run:
        return recordings
    written = recordings.report(options.out) if options.out is not None else []
    for line in recordings.lines():
        print(line)
    for path in written:
        print(f"wrote {path}")
    return None
