"""Which candidates are refitted, which of equals is taken, and what is held out: on made-up scores and options."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

from made_up import found, option
from tubular_dea.discover import engine
from tubular_dea.discover.options import options
from tubular_dea.discover.options.options import Option
from tubular_dea.discover.scores import held_out, power
from tubular_dea.discover.scores.bank import Score
from tubular_dea.discover.scores.levels import course
from tubular_dea.discover.search import rounds
from tubular_dea.discover.search.rounds import Round
from tubular_dea.identify.fitting.fit import FitError
from tubular_dea.kernel import Trajectory
from tubular_dea.model.build import Build


def scored(*statistics: float) -> list[Score]:
    """Candidates c0, c1 ... with these scores."""
    return [Score(SimpleNamespace(effect=SimpleNamespace(id=f"c{i}")), value, {}) for i, value in enumerate(statistics)]


def refitted(*statistics: float, threshold: float = 30.0, most: int = rounds.MOST_REFITS) -> int:
    """How many of the candidates are."""
    chosen = rounds._shortlist(scored(*statistics), threshold, most)
    assert chosen == [f"c{i}" for i in range(len(chosen))]  # the best ones
    return len(chosen)


def test_the_best_candidates_are_refitted_and_all_near_them() -> None:
    assert refitted(1000.0, *[100.0] * 20) == 5
    assert refitted(1000.0, *[601.0] * 6, *[599.0] * 20) == 7
    assert refitted(1000.0, *[601.0] * 20) == 10
    assert refitted(150.0, *[51.0] * 6, *[49.0] * 20) == 7  # 100 below are near where evidence is weak
    assert refitted(40.0, 16.0, 14.0, 14.0, threshold=30.0) == 2  # half of the threshold


@pytest.mark.parametrize(
    ("excess", "best", "astray"),
    [
        (20_000.0, 9_000.0, True),  # of what is left, less than a half
        (20_000.0, 11_000.0, False),
        (100.0, 40.0, False),  # noise
    ],
)
def test_scores_that_promise_little_of_what_is_left_are_not_relied_on(excess: float, best: float, astray: bool) -> None:
    assert rounds._astray(option(excess=excess), scored(best)[0]) is astray


def levelled(low: float, high: float, level: float) -> tuple[str, ...]:
    """What is unreached where a state moves between `low` and `high` and a stop's level is there."""
    run = Trajectory(np.arange(2.0), {"x": np.array([low, high])}, 0, 0)
    study = SimpleNamespace(
        catalogue={"stop": SimpleNamespace(levels={"level": "x"}), "lag": SimpleNamespace(levels={})},
        training=[],
        geometry={},
        plant=SimpleNamespace(model=None),
        shared=lambda values: values,
        response=lambda ids, pieces: SimpleNamespace(trajectories=lambda values: [run]),
    )
    return options._unreached(study, ("lag", "stop"), SimpleNamespace(values={"level": level}))


def test_a_stop_that_always_or_never_holds_is_none() -> None:
    assert levelled(-1.0, 1.0, 0.9) == ()
    assert levelled(-1.0, 1.0, 1.1) == levelled(-1.0, 1.0, -1.1) == ("stop",)


def test_a_level_may_be_one_of_a_definition() -> None:
    """A preload of an elastic stress turns at a strain, which follows from the stretch that is prescribed."""
    m = Build("Strip")
    stretch, rest = m.input("stretch", "1", nominal=2.0), m.parameter("rest", "1", 1.0)
    strain = m.define("strain", "1", stretch - rest, nominal=1.0)
    twice = m.define("twice", "1", 2 * strain)
    m.output("force", "N", m.parameter("stiffness", "N", 3.0) * twice)
    run = Trajectory(np.arange(3.0), {"stretch": np.array([1.0, 1.5, 3.0])}, 0, 0)
    assert course(m.model(), run, "twice", {"rest": 0.5}) == pytest.approx([1.0, 2.0, 5.0])
    assert course(m.model(), run, "stretch", {}) == pytest.approx([1.0, 1.5, 3.0])


def test_where_models_are_far_nearly_all_are_refitted() -> None:
    assert refitted(10_000.0, *[301.0] * 12, *[299.0] * 20, most=rounds.ALL_REFITS) == 13
    assert refitted(10_000.0, *[301.0] * 40, most=rounds.ALL_REFITS) == 24


def test_a_refit_starts_from_the_best_shapes() -> None:
    assert len(rounds._distinct(scored(100.0, 51.0, 50.5))) == 2
    assert len(rounds._distinct(scored(100.0, 49.0))) == 1


def test_what_may_yet_win_is_near() -> None:
    best = option("lag", excess=0.0)
    assert rounds._near(option("slew", excess=499.0), best)
    assert not rounds._near(option("slew", excess=501.0), best)


def test_refits_within_reach_of_the_best_go_on_and_few_start_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """The chosen model leaves 6000, the best refit 1000: within 1500 of it, refits are made to the end."""
    left = {"c0": 1000.0, "c1": 2499.0, "c2": 2501.0, "c3": 2400.0, "c4": 2300.0}
    ended: list[str] = []
    again: list[tuple] = []

    def further(study: object, ids: tuple, fitted: object, evaluations: int, refined: tuple) -> object:
        ended.append(ids[-1])
        return fitted

    monkeypatch.setattr(
        rounds, "first_refit", lambda study, ids, fit, shapes, fine: option(excess=left[shapes[0].id]).fitted
    )
    monkeypatch.setattr(rounds, "further", further)
    monkeypatch.setattr(rounds, "option", lambda study, ids, fit, fine: option(*ids, excess=left[ids[-1]]))
    monkeypatch.setattr(rounds, "fitted_option", lambda study, ids, start, fine: again.append(ids))
    monkeypatch.setattr(rounds, "_from_best", lambda study, one, best: one)
    model = SimpleNamespace(parameter_values=lambda: {})
    study = SimpleNamespace(plant=SimpleNamespace(model=model))
    before = option(excess=6000.0)
    starts = [rounds._Start(before.fitted, scored(*[100.0] * 5))]
    found = rounds._refits(study, before, starts, list(left), {}, lambda what: None)
    assert [o.ids[-1] for o in found] == ["c0", "c4", "c3", "c1", "c2"]  # best first
    assert sorted(ended) == ["c0", "c1", "c3", "c4"]
    assert sorted(again) == [("c0",), ("c3",), ("c4",)]
    ended.clear()
    known = {"c2": option("c2", excess=900.0).fitted}  # of a search at another level of noise: it starts there
    monkeypatch.setattr(
        rounds, "fit_effects", lambda study, ids, values, steps, fine: further(study, ids, known["c2"], steps, fine)
    )
    rounds._refits(study, before, starts, list(left), known, lambda what: None)
    assert ended.index("c2") == 0
    ended.clear()

    def unsolvable(*given: object) -> None:
        raise FitError("beyond the fold")

    monkeypatch.setattr(rounds, "fit_effects", unsolvable)
    rounds._refits(study, before, starts, list(left), known, lambda what: None)
    assert "c2" not in ended  # it begins here, where it costs 2501, and what it cost there is nothing to go by


@pytest.mark.parametrize(
    ("there", "after", "kept"), [(900.0, 400.0, 400.0), (900.0, 1100.0, 1000.0), (1001.0, 0.0, 1000.0)]
)
def test_a_refit_that_ended_elsewhere_starts_again_where_the_best_ended(
    monkeypatch: pytest.MonkeyPatch, there: float, after: float, kept: float
) -> None:
    """The option costs 1000, and `there` with the base of the best one."""
    best, one = option("lag", excess=0.0), option("line", excess=1000.0 - option("line", excess=0.0).fitted.cost)
    best = replace(best, fitted=replace(best.fitted, values=best.fitted.values | {"base": 7.0}))
    assert one.fitted.cost == 1000.0
    started: list[dict] = []

    def fitted_option(study: object, ids: tuple, start: dict, fine: tuple) -> Option:
        started.append(start)
        return replace(one, fitted=replace(one.fitted, cost=after))

    residuals = SimpleNamespace(scaled=lambda values: values, residuals=lambda values: np.array([there**0.5]))
    study = SimpleNamespace(plant=None, problem=lambda ids, free, fixed: residuals)
    monkeypatch.setattr(rounds, "base_parameters", lambda plant: [SimpleNamespace(name="base")])
    monkeypatch.setattr(rounds, "fitted_option", fitted_option)
    assert rounds._from_best(study, best, best) is best
    assert rounds._from_best(study, one, best).fitted.cost == kept
    assert started == ([one.fitted.values | {"base": 7.0}] if there < 1000.0 else [])


@pytest.mark.parametrize(
    ("left", "first", "finer"),
    [
        (600.0, False, True),  # a further effect
        (600.0, True, False),  # a first one, clearly
        (480.0, True, True),  # a weak one
        (430.0, False, False),  # none
    ],
)
def test_weak_and_further_effects_compete_in_their_finer_forms(
    monkeypatch: pytest.MonkeyPatch, left: float, first: bool, finer: bool
) -> None:
    """A drift in its straight form gains nearly nothing, and the most where it levels off."""
    fine = {"drift": 230.0, "friction": 470.0, "stop": 0.0}
    monkeypatch.setattr(
        "tubular_dea.discover.options.options.fitted_option",
        lambda study, ids, start, refined: option(*ids, excess=fine[ids[-1]], refined=refined),
    )
    plain = SimpleNamespace(parameters=(), refine=())
    forms = {i: SimpleNamespace(parameters=(), refine=("form",)) for i in fine}
    study = SimpleNamespace(catalogue={"set": plain, "delay": plain, **forms})
    found = () if first else ("delay",)
    before = option(*found, excess=left)
    coarse = {"set": 400.0, "friction": 420.0, "drift": 425.0, "stop": 1000.0}
    options = [option(*found, i, excess=excess) for i, excess in coarse.items()]
    compared = rounds._as_finer(study, before, options, 35.0, lambda what: None)
    assert [o.ids[-1] for o in compared] == (
        ["drift", "set", "friction", "stop"] if finer else ["set", "friction", "drift", "stop"]
    )
    assert [o.refined for o in compared] == ([("drift",), (), (), ()] if finer else [(), (), (), ()])


@pytest.mark.parametrize(
    ("behind", "recording", "taken"),
    [
        (11.0, True, 1),  # of equals, a fault of a monitor is the plainer answer
        (11.0, False, 0),
        (13.0, True, 0),  # it is no equal
    ],
)
def test_of_equals_a_fault_of_a_monitor_is_taken(behind: float, recording: bool, taken: int) -> None:
    study = SimpleNamespace(
        catalogue={"lag": SimpleNamespace(recording=False), "zero": SimpleNamespace(recording=recording)}
    )
    options = [option("lag", excess=0.0), option("zero", excess=behind)]
    assert rounds._preferred(study, options, [0, 1]) == taken


def test_of_equals_far_from_the_plant_the_usual_size_is_taken() -> None:
    """A fifth of what is left says nothing there; `wild` has twelve times its usual size."""
    effects = {
        name: SimpleNamespace(
            off={name: 0.0},
            typical={name: typical},
            fit=(name,),
            trades={},
            hard=(),
            recording=False,
            parameters=[SimpleNamespace(name=name, nominal=1.0)],
        )
        for name, typical in (("wild", 1 / 12), ("usual", 1.0))
    }
    best, rival = option("wild", excess=800_000.0), option("usual", excess=900_000.0)
    study = SimpleNamespace(catalogue=effects)
    assert rounds._preferred(study, [best, rival], [0, 1]) == 1
    worse = option("usual", excess=1_000_000.0)
    assert rounds._preferred(study, [best, worse], [0, 1]) == 0


@dataclass(frozen=True)
class Piece:
    """A piece of so many samples."""

    record: np.ndarray
    held_out: bool = False
    name: str = ""


@dataclass(frozen=True)
class Pieces:
    """A study that has nothing but pieces."""

    pieces: list[Piece]

    @property
    def held_out(self) -> list[Piece]:
        return [p for p in self.pieces if p.held_out]


@pytest.mark.parametrize(
    ("sizes", "wanted", "held"),
    [
        ([100] * 8, [0.1, 0.5, 0.4, 0.3, 0.0, 0.0, 0.0, 0.0], [1, 2]),  # one in four, the worthiest
        ([190, 90, 90, 90, 90, 90, 180, 180], [0.5, 0.1, 0, 0, 0, 0, 0.4, 0], [0, 1]),  # 0 and 6 are more than 30 %
        ([210, 90, 90, 90, 90, 90, 170, 170], [0.5, 0.3, 0.2, 0, 0, 0, 0, 0], [1, 2]),  # 0 is more than 20 %
        ([500, 500, 500], [0.5, 0.3, 0.2], []),  # each is
    ],
)
def test_long_experiments_are_kept_for_fits(
    monkeypatch: pytest.MonkeyPatch, sizes: list[int], wanted: list[float], held: list[int]
) -> None:
    information = SimpleNamespace(
        worth=lambda chosen: sum(wanted[i] for i in chosen), confirmed=lambda chosen: 0.0, dear=lambda chosen: 0.0
    )
    monkeypatch.setattr(held_out, "_information", lambda study, effects: information)
    study = Pieces([Piece(np.zeros(n)) for n in sizes])
    chosen = held_out.with_held_out(study)
    assert [i for i, p in enumerate(chosen.pieces) if p.held_out] == held


@pytest.mark.parametrize(("count", "held"), [(5, [3]), (2, [0])])
def test_others_are_held_out_in_place_of_those_that_are_needed(
    monkeypatch: pytest.MonkeyPatch, count: int, held: list[int]
) -> None:
    """Of five files of a laser behind a filter four were held out, and parameters came from the beats alone."""
    wanted = [0.1, 0.5, 0.2, 0.3, 0.0]
    information = SimpleNamespace(
        worth=lambda chosen: sum(wanted[i] for i in chosen), confirmed=lambda chosen: 0.0, dear=lambda chosen: 0.0
    )
    monkeypatch.setattr(held_out, "_information", lambda study, effects: information)
    study = Pieces([Piece(np.zeros(100), i == 1, f"file {i}") for i in range(count)])
    assert [i for i, p in enumerate(engine._exchanged(study).pieces) if p.held_out] == held


def test_of_experiments_that_are_as_good_the_one_that_shows_most_is_held_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """A ramp of 4 kV costs nothing where it is held out, as it tells nothing."""
    worth, shows, costs = [0.14, 0.12, 0.13, 0.04], [0.17, 0.28, 0.66, 0.34], [0.03, 0.15, 0.6, 0.28]
    information = SimpleNamespace(
        worth=lambda chosen: sum(worth[i] for i in chosen),
        confirmed=lambda chosen: sum(shows[i] for i in chosen),
        dear=lambda chosen: sum(costs[i] for i in chosen),
    )
    monkeypatch.setattr(held_out, "_information", lambda study, effects: information)
    monkeypatch.setattr(held_out, "HELD_LONG", 0.3)
    chosen = held_out.with_held_out(Pieces([Piece(np.zeros(100)) for _ in worth]))
    assert [i for i, p in enumerate(chosen.pieces) if p.held_out] == [1]


def test_beyond_its_grid_the_gain_of_a_lag_grows_with_a_power_of_its_length() -> None:
    def crossing(slope: float, level: float) -> float:
        x = np.log([1.0, 2.0, 4.0])
        return float(np.exp(power._crossing(x, slope * x, level)))

    assert crossing(3.0, 3 * np.log(3.0)) == pytest.approx(3.0)  # inside
    assert crossing(3.0, 3 * np.log(0.5)) == pytest.approx(0.5)  # below, as between its points
    assert crossing(1.0, 2 * np.log(0.5)) == pytest.approx(0.5)  # but with the square at least
    assert crossing(9.0, 4 * np.log(0.5)) == pytest.approx(0.5)  # and the fourth power at most
    assert crossing(1.0, np.log(4.0) + 2 * np.log(2.0)) == pytest.approx(8.0)  # above, with the square
    nothing_at_last = power._crossing(np.log([1.0, 2.0, 4.0]), np.array([-690.0, 3.0, -690.0]), 5.0)
    assert np.exp(nothing_at_last) == pytest.approx(2.0 * np.e)  # from where most is scored


def test_what_no_size_shows_has_no_detection_limit() -> None:
    search = power._SizeSearch(power.Guess(SimpleNamespace(id="one"), {}, "size", 1.0, 1.0), [1.0])
    while len(search.scores) < power.SIMULATED:
        search.scored(0.0, 45.2, taken=False)
    assert search.limit(45.2) is None


def test_experiments_are_held_out_anew_where_those_held_out_do_not_show_what_the_others_do(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    pieces = [Piece(np.zeros(500)) for _ in range(5)]
    prepared, shows = Pieces(pieces), Pieces([replace(p, held_out=i == 2) for i, p in enumerate(pieces)])
    monkeypatch.setattr(engine, "with_held_out", lambda study, ids: shows if ids == ("lag",) else study)
    base = option(excess=900.0, held_out=2000.0)
    step = Round((), [], None, 30.0, [], True, "")

    def other(chosen: Option) -> object:
        return engine._held_out_anew(prepared, found(base, chosen, rounds=[step]))

    assert other(option("lag", excess=0.0, held_out=2005.0, turned=0.1)) is shows
    assert other(option("lag", excess=0.0, held_out=1990.0, turned=0.1)) is None  # they support it
    assert other(option("lag", excess=850.0, held_out=2005.0, turned=0.1)) is None  # it gains little
    assert other(option("lag", excess=0.0, across=base.across, held_out=2005.0, turned=0.1)) is None  # nothing does
    assert other(option("creep", excess=0.0, held_out=2005.0, turned=0.1)) is None  # there are no others
    assert other(option(excess=900.0)) is None


@pytest.mark.parametrize(("known_to", "error", "kept"), [(0.003, 0.08, True), (0.003, 0.1, False), (0.1, 4.0, True)])
def test_a_finer_form_that_leaves_other_parameters_vaguer_is_none(
    known_to: float, error: float, kept: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A prestretch of two directions gained 93 more and said what C_1 does, which was known to 0.3 % without it."""
    study = SimpleNamespace(catalogue={"prestretch": SimpleNamespace(parameters=[SimpleNamespace(name="prestretch")])})
    one, finer = option("prestretch"), option("prestretch", refined=("prestretch",))
    known = replace(one, fitted=replace(one.fitted, stderr={"base": known_to, "prestretch": 0.1}))
    vague = replace(finer, fitted=replace(finer.fitted, stderr={"base": error, "prestretch": 0.1}))
    monkeypatch.setattr(options, "fitted_option", lambda *asked: vague)
    assert options.finer_form(study, known, ["prestretch"]) is (vague if kept else None)
    monkeypatch.setattr(options, "fitted_option", lambda *asked: None)
    assert options.finer_form(study, known, ["prestretch"]) is None


@pytest.mark.parametrize(("trade", "length", "growth"), [(1.0, 0.1, 1.0), (-1.0, 412.6, -1.0), (0.0, 412.6, -1.0)])
def test_a_lag_grows_with_its_length_whatever_longer_ones_score(trade: float, length: float, growth: float) -> None:
    """Of lags longer than a record other parameters take more: one of 350 000 s was said to be the shortest seen."""
    listed = [SimpleNamespace(shape={"tau": tau}) for tau in (10.0, 30.0, 100.0)]
    size, found = power._length("tau", listed, [1e4, 5e3, 100.0], 1.0, trade)
    assert (size, found) == (pytest.approx(length, rel=1e-3), growth)
