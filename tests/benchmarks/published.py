"""Our optimum beside what the device's makers publish: run it as a script.

    python tests/benchmarks/published.py

Published, as the issue reports it: in vitro 5.5 % less energy of the heart at 47 mJ a cycle; in pigs at 100 beats a
minute the best pulse began 30 ms before systole and ended 0 to 30 ms after diastole began.
"""

from __future__ import annotations

from told import parser
from tubular_dea.control.optimum import Limits, optimise
from tubular_dea.cosim.beats import beats
from tubular_dea.cosim.course import follow
from tubular_dea.cosim.trial import Trial
from tubular_dea.model.windkessel import patient

CASES = {
    "failing": patient("failing"),
    "healthy": patient("healthy"),
    "healthy at 100 a minute": patient("healthy", {"heart_rate": 100 / 60}),
}


def main() -> None:
    """A row for each patient, computed by the map and run by the scheduler."""
    print(
        "patient                  kV    V/um  begin: before ejection  end: after closure  stroke work  per volume  "
        "electrical"
    )
    for name, values in CASES.items():
        best = optimise(values, Limits())
        trial = Trial.of(values, 15)
        pulse = {
            "scheduler.voltage_on": best.pulse.voltage,
            "scheduler.on_fraction": best.pulse.begin,
            "scheduler.off_fraction": best.pulse.end,
        }
        assisted = trial.run(pulse)
        course = follow(trial.run({**pulse, "scheduler.voltage_on": 0.0}), assisted)
        beat = beats(assisted)[-1]
        assert beat.ejection is not None
        closure = 1e3 * (best.pulse.end * best.period - (beat.ejection[1] - beat.time[0]))
        work, per = (100 * (course.change(n) or 0.0) for n in ("stroke_work", "stroke_work_per_stroke_volume"))
        print(
            f"{name:23}  {best.pulse.voltage / 1e3:.2f}  {course.largest_field * 1e-6:.1f}  "
            f"{-1e3 * best.ahead:14.0f} ms  {closure:17.0f} ms  {work:+9.1f} %  {per:+8.1f} %  "
            f"{1e3 * course.assisted['electrical_energy'].mean:6.0f} mJ"
        )


if __name__ == "__main__":
    parser(__doc__).parse_args()
    main()
