"""Why an answer rests on little: few experiments, noise that nothing tells, inputs that hardly move."""

from __future__ import annotations

import numpy as np

from ...identify.study.nuisances import START_OF
from ...model.starts import unknowns
from ...model.units import in_words, three
from ..alternatives.input_noise import allowed_rms
from ..engine import Discovery
from ..options.acceptance import PREDICTED, clean, size_interval
from ..options.residuals import LackOfFit
from ..scores.parameters import at_bounds, implausible_values

# Set by judgement. Check: `python -m blind.score --external 12 --seed 1000`
FEW_EXPERIMENTS = 3  # [1] experiments below which a verdict rests on little
DROWNED = 0.5  # [1] share of an output's deviation from its mean from which on noise may be all that it shows
MOVES = 10.0  # [1] times a monitor's noise that an input spans in some experiment, else it hardly moves

# Set by judgement: one parameter that refines a form often ends its range. Check:
# `pytest tests/test_report_words.py -k uncertain`
ENDS = 2  # [1] parameters of one effect that ended at bounds, from which on its law is uncertain


def thin(found: Discovery) -> str:
    """Why these recordings can show little; "" where they are many."""
    files = {p.source for p in found.study.pieces}
    if len(files) < FEW_EXPERIMENTS:
        what = "one experiment" if len(files) == 1 else f"{len(files)} experiments"
        return f"there {'is' if len(files) == 1 else 'are'} only {what}"
    ratio = found.named.lack_of_fit.ratio
    if found.verdict == "no_effect" and ratio > PREDICTED:
        return f"the error is {ratio:.1f} times the noise, and they hardly tell how large that is"
    return ""


def forced(found: Discovery) -> list[str]:
    """That a law explains the recordings only at ends of what its parameters may be, so that it may stand in for
    another."""
    ended = {name: [*at_bounds(found.study.catalogue[name], found.named.fitted)] for name in found.named.ids}
    return [
        f"{name} explains the recordings only at the ends of what {' and '.join(its)} may be: something else, perhaps "
        "in no catalogue, may act like it."
        for name, its in ended.items()
        if len(its) >= ENDS
    ]


def compensating(found: Discovery) -> list[str]:
    """Where a residual stays, that parameters of the model that is handed out make up for what is missing by values
    that no such plant has: it is good for nothing but these recordings."""
    far_off = implausible_values(found.study.plant, found.named.fitted)
    if found.verdict not in ("unexplained", "partly_explained") or not far_off:
        return []
    times = ", ".join(f"{name} {three(by)}" for name, by in far_off.items())
    return [
        "Do not use the model in model.json and the FMU beyond these recordings: unless declared values were first "
        f"guesses, its parameters make up for what is missing ({times} times as declared)."
    ]


def from_the_start(found: Discovery) -> list[str]:
    """That a named effect is slower than the records are long, each of which begins at its own state of it: a voltage
    of 260 V that never changes was a trap of 980 s with 58 kV in it."""
    study, fitted, said = found.named_study, found.named.fitted, []
    longest = max(float(np.ptp(p.case.times)) for p in study.pieces)
    free = {n.removeprefix(START_OF) for p in study.pieces for n in p.nuisances.names}
    others = unknowns(study.compiled.model(()))
    for name in found.named.ids:
        effect = study.catalogue[name]
        times = [q.name for q in effect.parameters if q.unit == "s" and q.name in fitted.names]
        slow = [n for n in times if size_interval(effect, fitted, n)[0] > longest]
        if slow and (unknowns(study.compiled.model((name,))).keys() - others.keys()) & free:
            said.append(
                f"{name} is slower ({' and '.join(slow)}) than the longest recording ({in_words(longest, 's')}), and "
                "its states begin where each recording says: there it is something constant from the start, whatever "
                "brought it about. Begun at rest or in equilibrium, model.json and the FMU show nothing of it."
            )
    return said


def loud(found: Discovery) -> str:
    """Why it is open whether a residual beside which nothing is named is noise: no stretch is quiet, or noise may be
    all that there is; "" where it is not."""
    if found.verdict != "no_effect":
        return ""
    if drowned := hidden_by_noise(found):
        return drowned
    if clean(found.named.lack_of_fit) or quiet(found):
        return ""
    return f"no stretch is quiet, and {slow_part(found.named.lack_of_fit, 'could be estimated')}"


def hidden_by_noise(found: Discovery) -> str:
    """Which output hardly moves by more than its noise and that of the inputs, with their edges, allow; "" for none."""
    for name, allowed in allowed_rms(found.study).items():
        read = [
            p.record[part]
            for p in found.study.pieces
            for reading, part in zip(p.case.readings, p.case.parts, strict=True)
            if reading.output == name
        ]
        noise = found.study.noise[name]  # where it is slow, it weighs more on averages than it is large
        most = float(np.sqrt(noise.rms**2 + max(allowed**2 - noise.slow**2, 0.0)))
        share = most / max(float(np.std(np.concatenate(read))), 1e-300)
        if share > DROWNED:
            return f"what noise may make of {name}, the inputs' too, is {share:.2g} times as large as all that it does"
    return ""


def still(found: Discovery) -> str:
    """Which inputs barely move in any experiment, nor from one to the next; "" where all do."""
    names = [s.name for s in found.study.plant.inputs if not _moves(found, s.name)]
    return f"{' and '.join(names)} barely move{'s' if len(names) == 1 else ''} in any experiment" if names else ""


def quiet(found: Discovery) -> bool:
    """Whether quiet stretches tell the noise of every output."""
    return all(noise.quiet for noise in found.study.noise.values())


def slow_part(state: LackOfFit, told: str) -> str:
    """How the slow part of a residual compares with the noise that was `told`."""
    return f"the slow part of the residual is {state.coloured**0.5:.1f} times that of the noise that {told}"


def _moves(found: Discovery, name: str) -> bool:
    values = np.concatenate([p.case.protocol.inputs[name] for p in found.study.pieces])
    return float(np.ptp(values)) > MOVES * found.study.monitor_noise.get(name, 0.0)
