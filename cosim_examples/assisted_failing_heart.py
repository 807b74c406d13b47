"""A failing heart with and without assist: three FMUs, strongly coupled.

    python cosim_examples/assisted_failing_heart.py

Writes assisted_failing_heart.png. `tubular-dea assist` does the same with a report.
"""

from __future__ import annotations

import tubular_dea as td


def main() -> None:
    """Twelve beats of each: the figures, and the last beats as a picture."""
    helped = td.assist("failing", "5.5 kV", beats=12)
    print("\n".join(helped.lines()))
    helped.plot_beats().savefig("assisted_failing_heart.png")


if __name__ == "__main__":
    main()
