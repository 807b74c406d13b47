"""Patients: known ones, and one fitted to a recorded arterial pressure."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import ArgumentError
from ..files import FileError, write_atomically
from ..model.units import factor
from ..model.windkessel import PARAMETERS
from ..patients.patient import OUTPUT_UNCERTAINTY, Patient
from ..patients.patient import fit_patient as fitted
from ..patients.recorded_beat import RecordedBeat, average, read_signals
from ..progress import progress_bar
from . import tables
from .given import Amount, amount
from .heart import AnyPatient, patient_of

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure

ASSUMED = "5 L/min"

# Set by convention: from a small newborn's to an athlete's (42 L/min: B. Ekblom and L. Hermansen, J. Appl. Physiol. 25
# (1968) 619). Check: `pytest tests/test_patient.py -k refused`
LEAST_OUTPUT = 0.2  # [L/min] of a heart at rest,
MOST_OUTPUT = 45.0  # [L/min] and at its most


@dataclass(frozen=True, repr=False)
class PatientResult:
    """A patient fitted to the average `beat` of `recording`: `values` (SI) by name are what `assist` takes.

    `found` has the estimates with their intervals; `based_on` is the patient for everything that cannot be identified;
    `assumed` the cardiac output [m3/s] where there was no flow.
    """

    recording: Path
    beat: RecordedBeat
    found: Patient
    based_on: str
    assumed: float | None

    def __repr__(self) -> str:
        return f"<PatientResult: {self.lines()[0]}>"

    @property
    def values(self) -> dict[str, float]:
        """The complete parameter set in SI units."""
        return dict(self.found.values)

    def lines(self) -> list[str]:
        """A summary of the fit, and the parameters with their intervals, as text."""
        said = self._header()
        for name, text, interval, remark in self._rows():
            said.append(f"{name:16} {text:>22}  {interval:24} {remark}")
        return said

    def to_pandas(self) -> pandas.DataFrame:
        """One row a fitted parameter: value, 95 % interval, whether identified, SI unit. Needs the extra `tables`."""
        units = {p.quantity.name: p.quantity.unit for p in PARAMETERS}
        rows = [
            {"parameter": n, "value": e.value, "low": e.low, "high": e.high}
            | {"identified": e.identified, "unit": units[n]}
            for n, e in self.found.estimates.items()
        ]
        return tables.table(rows, "parameter")

    def plot(self, figure: Figure | None = None) -> Figure:
        """The recorded beat and the patient's; drawn into `figure` if it is given."""
        from ..report.patient import draw

        return draw(self.beat, self.found, figure)

    def report(self, out: str | Path) -> list[Path]:
        """Write the patient to `out` (a .toml, for ``assist``) and the picture beside it; returns their paths."""
        from ..report.figures import png

        out = Path(out)
        if out.suffix != ".toml":
            raise ArgumentError("out", f" {out}: expected a file that ends in .toml")
        picture = png(self.plot())
        written = write_atomically(out, self._toml().encode())
        try:
            return [written, write_atomically(out.with_suffix(".png"), picture)]
        except FileError as problem:  # a full disk
            raise FileError(f"{problem}; the patient is in {written}, without its picture") from None

    def _header(self) -> list[str]:
        """A summary of the fit in sentences."""
        beat, found = self.beat, self.found
        mmhg, litres = factor("Pa", "mmHg"), factor("m3/s", "L/min")
        beats = "one beat" if beat.beats == 1 else f"the average of {beat.beats} beats, cut at the {beat.by}"
        lines = [
            f"Fitted by tubular-dea patient to {self.recording.name}: {beats}, {60 / beat.period:.1f} a minute.",
            f"Misfit of the pressure {found.misfit * mmhg:.2f} mmHg rms, of a swing of "
            f"{(beat.pressure.max() - beat.pressure.min()) * mmhg:.1f}; cardiac output "
            f"{found.cardiac_output * litres:.2f} L/min.",
        ]
        lines += beat.remarks
        if self.assumed is not None:
            lines.append(
                f"No flow was recorded: {self.assumed * litres:g} L/min (+- {100 * OUTPUT_UNCERTAINTY:.0f} %) is "
                "assumed, and all volumes, flows, compliances and resistances scale with it."
            )
            away = found.cardiac_output / self.assumed - 1
            if abs(away) > OUTPUT_UNCERTAINTY / 2:
                lines.append(
                    f"The recorded pressure fits an output {100 * abs(away):.0f} % {'below' if away < 0 else 'above'} "
                    "the assumed one better, which its uncertainty allows."
                )
        unknown = [n for n, e in found.estimates.items() if not e.identified]
        if unknown:
            lines.append(
                f"Not identifiable from this recording, near {self.based_on}'s (scaled): {', '.join(unknown)}."
            )
        return lines

    def _rows(self) -> list[tuple[str, str, str, str]]:
        """Name, value, interval and meaning of every fitted parameter, in customary units."""
        units, rows = _shown_units(), []
        meanings = {p.quantity.name: p.quantity.description for p in PARAMETERS}
        for name, e in self.found.estimates.items():
            scale, unit = factor(*units[name]), units[name][1]
            interval = f"95 %: {e.low * scale:.4g} to {e.high * scale:.4g}"
            rows.append(
                (
                    name,
                    f"{e.value * scale:.5g} {unit}",
                    interval,
                    meanings[name] + ("" if e.identified else " (not identifiable)"),
                )
            )
        return rows

    def _toml(self) -> str:
        """A whole patient: fitted parameters with their intervals, then the others."""
        units = _shown_units()
        lines = [*(f"# {line}" for line in self._header()), ""]
        for name, text, interval, remark in self._rows():
            entry = f'{name} = "{text}"'
            lines.append(f"{entry:44} # {interval}; {remark}")
        lines += ["", "# Taken over, scaled, or from the steady beat:"]
        for name, value in self.found.values.items():
            if name in self.found.estimates:
                continue
            scale, unit = factor(*units[name]), units[name][1]
            shown = str(int(value)) if name == "elements" else f'"{value * scale:.6g} {unit}"'
            lines.append(f"{name} = {shown}")
        return "\n".join(lines) + "\n"


def patient(patient: AnyPatient) -> dict[str, float]:
    """A patient's parameters: ventricle and windkessel.

    Parameters
    ----------
    patient : str, Path or mapping
        ``"failing"``, ``"healthy"``, ``"stiff"``, a TOML file, or all values by name (SI, or with a unit).

    Returns
    -------
    dict of str to float
        The complete set in SI units, checked.

    Raises
    ------
    UserError
        For an unknown patient, and for values that are missing or out of bounds.

    Examples
    --------
    >>> import tubular_dea as td
    >>> failing = td.patient("failing")
    >>> f"{60 * failing['heart_rate']:.0f} a minute"
    '75 a minute'
    >>> stiffer = td.patient({**failing, "C": "0.6 mL/mmHg"})

    Source: M. A. Simaan et al., IEEE Trans. Control Syst. Technol. 17 (2009) 994-1008, and those named in
    `tubular_dea.model.patients`.
    """
    return patient_of(patient)


def fit_patient(
    recording: str | Path,
    flow: str | Path | None = None,
    *,
    cardiac_output: Amount | None = None,
    based_on: AnyPatient = "healthy",
    progress: bool = False,
) -> PatientResult:
    """A patient whose steady beat is nearest to a recorded arterial pressure, with intervals.

    Parameters
    ----------
    recording : str or Path
        A table with the columns time, pressure and optionally flow and ecg; or a WFDB record (.hea).
    flow : str or Path, optional
        A second table, with the aortic flow over the same time.
    cardiac_output : float or str, optional
        Assumed [m3/s] where there is no flow (default: 5 L/min, +- 20 %).
    based_on : str, Path or mapping
        The patient for everything that the recording does not identify.
    progress : bool
        Show a bar on standard error.

    Returns
    -------
    PatientResult
        The parameters with intervals; ``assist(result.values)`` takes them.

    Raises
    ------
    UserError
        For recordings without beats, and where no patient of this model has such a beat.

    References
    ----------
    M. A. Simaan et al., "A dynamical state space representation and performance analysis of a feedback-controlled
    rotary left ventricular assist device", IEEE Trans. Control Syst. Technol. 17 (2009) 15-28: the healthy values.

    N. Stergiopulos, J. J. Meister, N. Westerhof, "Determinants of stroke volume and systolic and diastolic aortic
    pressure", Am. J. Physiol. 270 (1996) H2050-H2059: the activation.

    Examples
    --------
    >>> import tubular_dea as td
    >>> found = td.fit_patient("cosim_examples/data/heartbeat.csv")
    >>> f"{60 / found.beat.period:.0f} a minute"
    '72 a minute'
    """
    base = patient_of(based_on)
    beat = average(read_signals(Path(recording), None if flow is None else Path(flow)), str(recording))
    assumed = _assumed(cardiac_output, beat)
    with progress_bar(unit="run", desc="fit", disable=not progress) as bar:
        found = fitted(beat, base, assumed, bar.update)
    name = "the given patient" if isinstance(based_on, dict) else str(based_on)
    return PatientResult(Path(recording), beat, found, name, assumed)


def _assumed(given: Amount | None, beat: RecordedBeat) -> float | None:
    """The assumed cardiac output [m3/s]; None where a flow was recorded."""
    if beat.flow is None:
        value = amount(ASSUMED if given is None else given, "m3/s", "cardiac_output")
        if not LEAST_OUTPUT <= value * factor("m3/s", "L/min") <= MOST_OUTPUT:
            raise ArgumentError(
                "cardiac_output",
                f": expected {LEAST_OUTPUT:g} to {MOST_OUTPUT:g} L/min (a small newborn's to an athlete's) but "
                f"was given {value * factor('m3/s', 'L/min'):.4g} L/min; a number without a unit is in m3/s",
            )
        return value
    if given is not None:
        raise ArgumentError("cardiac_output", ": the recording has a flow, which determines it; leave this out")
    return None


def _shown_units() -> dict[str, tuple[str, str]]:
    """The SI unit and the customary unit of every parameter."""
    return {p.quantity.name: (p.quantity.unit, p.quantity.display_unit or p.quantity.unit) for p in PARAMETERS}
