"""What the amplifier's current monitor adds: `python -m blind.current --singles 1 --seed 4000` in tests/.

Every single effect is hidden twice in the same tube under the same protocols, recorded once with the radius alone and
once with the current beside it. Printed are both answers, and by how much the sets of equivalent effects shrink.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass

from tqdm import tqdm

from blind.effects import EFFECTS, channel
from blind.trials import Trial, trial


@dataclass(frozen=True)
class Both:
    """The same tube recorded without and with the current monitor."""

    alone: Trial
    beside: Trial

    @property
    def line(self) -> str:
        """Both answers."""
        return f"{self.alone.name:34s} {_answer(self.alone):60s} | {_answer(self.beside)}"


def _answer(t: Trial) -> str:
    mark = "ok" if t.right else "--"
    sets = "; ".join("/".join([f, *e]) for f, e in zip(t.found, t.equivalent, strict=True))
    return f"{mark} {t.verdict}: {sets or t.words}"


def _members(trials: list[Trial]) -> float:
    """Mean number of effects in a set, where the answer is right."""
    sizes = [1 + len(e) for t in trials for e in t.equivalent]
    return sum(sizes) / max(len(sizes), 1)


def main() -> None:
    """One line a pair, then the figures by channel of what was hidden."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--singles", type=int, default=1, help="tubes of each effect")
    parser.add_argument("--seed", type=int, default=4000, help="of the first tube")
    parser.add_argument(
        "--only", nargs="+", default=list(EFFECTS), choices=list(EFFECTS), metavar="ID", help="effects that are hidden"
    )
    options = parser.parse_args()
    todo = [(options.seed + i, kind) for kind in options.only for i in range(options.singles)]
    pairs = []
    for seed, kind in tqdm(todo, file=sys.stderr):
        pair = Both(trial(seed, kind, [], False, None), trial(seed, kind, ["current"], False, None))
        pairs.append(pair)
        tqdm.write(pair.line)
    for name in sorted({channel(p.alone.hidden[0]) for p in pairs}):
        here = [p for p in pairs if channel(p.alone.hidden[0]) == name and p.alone.right and p.beside.right]
        print(
            f"{name}: {len(here)} right in both; effects in a set {_members([p.alone for p in here]):.2f} with the "
            f"radius alone, {_members([p.beside for p in here]):.2f} with the current beside it"
        )


if __name__ == "__main__":
    main()
