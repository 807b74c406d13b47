"""How a search is revised: effects exchanged, given up, refined or withdrawn again; on made-up numbers."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from made_up import BASE, LARGE, STUDY, found, option
from tubular_dea.discover import judgement
from tubular_dea.discover.options import options as all_options
from tubular_dea.discover.options.options import Option
from tubular_dea.discover.search import revision, selection
from tubular_dea.discover.search.revision import Search
from tubular_dea.discover.search.rounds import Round


def refits(monkeypatch: pytest.MonkeyPatch, options: dict[tuple, Option]) -> list[tuple]:
    """Refits of `revision` give these options, by effects and finer forms; returns what was asked for."""
    asked: list[tuple] = []

    def fitted_option(study: object, ids: tuple, start: object, refined: tuple) -> Option | None:
        finer = tuple(i for i in ids if i in refined)
        asked.append((ids, finer))
        return options.get((ids, finer))

    for room in (revision, all_options):
        monkeypatch.setattr(room, "fitted_option", fitted_option)
    return asked


def taken(*options: Option) -> Round:
    """A round in which the first of some options was accepted."""
    return Round(options[0].ids[:-1], [], None, 30.0, list(options), True, "")


def two_effects(**more: object) -> Search:
    """Lag was found first (slew behind it by 100), then creep, which brought 1000."""
    first = taken(option("lag", excess=1000.0), option("slew", excess=1100.0), option("set", excess=4000.0))
    chosen = option("lag", "creep", excess=0.0, z_slow=0.0)
    return found(BASE, chosen, rounds=[first, taken(chosen)], gains={"creep": 1000.0}, **more)


def test_an_earlier_effect_is_exchanged_where_another_does_better_in_company(monkeypatch: pytest.MonkeyPatch) -> None:
    better = option("slew", "creep", excess=-100.0, z_slow=0.0)
    asked = refits(
        monkeypatch,
        {
            (("slew", "creep"), ()): better,
            (("slew",), ()): option("slew", excess=1100.0),
            (("creep",), ()): option("creep", excess=30_000.0),
        },
    )
    search = two_effects()
    revision.revise(search, lambda what: None)
    assert search.chosen is better
    assert [r.ids for r in search.rivals] == [("lag", "creep")]
    assert search.gains == {"creep": 1200.0, "slew": 30_100.0}
    assert (("set", "creep"), ()) not in asked  # it was further behind than creep brought, times 2.5


def test_an_effect_far_from_the_plant_is_exchanged_by_what_its_own_starts_predict(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Far from the plant a start that was estimated with another effect makes the right one predict badly."""
    left = LARGE * 25
    first = taken(option("lag", excess=left), option("slew", excess=left + 1000.0))
    chosen = option("lag", "creep", excess=left / 5)
    misled = option("slew", "creep", excess=1000.0, held_out=1e7)
    mended = replace(misled, unseen=misled.unseen / 100)
    asked = refits(monkeypatch, {(("slew", "creep"), ()): misled})
    monkeypatch.setattr(revision, "iterated", lambda study, one: ("its own", mended))
    search = found(BASE, chosen, rounds=[first, taken(chosen)], gains={"creep": left})
    revision._exchange(search, lambda what: None)
    assert asked and search.chosen is mended and search.study == "its own"
    monkeypatch.setattr(revision, "iterated", lambda study, one: ("its own", misled))
    search = found(BASE, chosen, rounds=[first, taken(chosen)], gains={"creep": left})
    revision._exchange(search, lambda what: None)
    assert search.chosen is chosen and search.study is STUDY


def test_of_effects_that_do_as_well_in_place_of_one_the_usual_size_is_taken() -> None:
    """Far from the plant a fifth of what is left says nothing."""
    chosen = option("lag", "creep", excess=4e5)
    wild = option("slew", "creep", excess=2e5)
    wild = replace(wild, fitted=replace(wild.fitted, values={"base": 1.0, "slew": 12.0}))
    plain, behind = option("set", "creep", excess=2.3e5), option("set", "creep", excess=2.6e5)
    for other, best in ((plain, plain), (behind, wild)):
        search = found(BASE, chosen)
        assert revision._better(search, "lag", [(STUDY, wild), (STUDY, other)]) == (STUDY, best)
    slightly = option("set", "creep", excess=3.4e5)
    assert revision._better(found(BASE, chosen), "lag", [(STUDY, slightly)]) == (STUDY, chosen)


@pytest.mark.parametrize(
    ("score", "gained", "taken"),
    [
        (990.0, 5.0, "lag"),  # with switching instants of its own it gains what it promised
        (890.0, 5.0, "slew"),  # others promised more
        (990.0, 500.0, "slew"),  # it was fitted well
    ],
)
def test_a_refit_that_keeps_nothing_of_its_promise_begins_anew(
    monkeypatch: pytest.MonkeyPatch, score: float, gained: float, taken: str
) -> None:
    scores = [SimpleNamespace(id="slew", statistic=1000.0), SimpleNamespace(id="lag", statistic=score)]
    chosen, rival = option("slew", excess=LARGE - 1000.0), option("lag", excess=LARGE - gained)
    mended = option("lag", excess=LARGE - 2000.0)
    monkeypatch.setattr(selection, "own_nuisances", lambda study, one: (study, one))
    monkeypatch.setattr(selection, "adjusted", lambda study, ids, values, free: STUDY)
    monkeypatch.setattr(selection, "start_values", lambda fitted, score: {"lag": 1.0})
    monkeypatch.setattr(selection, "fitted_option", lambda study, ids, start, refined: mended)
    search = found(
        BASE,
        chosen,
        rivals=[rival],
        rounds=[replace(Round((), [], None, 30.0, [chosen, rival], True, ""), scores=scores)],
    )
    search.gains = {"slew": 1000.0}
    selection._settle(search, BASE, lambda what: None)
    assert search.chosen.ids == (taken,)
    assert search.gains == {taken: 1000.0 if taken == "slew" else 2000.0}


@pytest.mark.parametrize(
    ("score", "gained", "accepted"),
    [
        (50.0, 5.0, True),  # with instants and zeros of its own it gains what it promised
        (29.0, 5.0, False),  # chance promises as much
        (50.0, 26.0, False),  # it was fitted well
    ],
)
def test_a_promise_that_nothing_kept_is_asked_of_numbers_of_its_own(
    monkeypatch: pytest.MonkeyPatch, score: float, gained: float, accepted: bool
) -> None:
    """An added mass scored 44 and gained 13 with the instants of the base; with its own it gains 112."""
    one, mended = option("lag", excess=LARGE - gained), option("lag", excess=LARGE - 112.0)
    monkeypatch.setattr(selection, "own_nuisances", lambda study, one: ("its own", one))
    monkeypatch.setattr(selection, "adjusted", lambda study, ids, values, free: STUDY)
    monkeypatch.setattr(selection, "start_values", lambda fitted, score: {"lag": 1.0})
    monkeypatch.setattr(selection, "fitted_option", lambda study, ids, start, refined: mended)
    monkeypatch.setattr(
        selection, "decided", lambda study, base, chosen, step: replace(step, accepted=step.options[0] is mended)
    )
    step = replace(Round((), [], None, 30.0, [one], False, ""), scores=[SimpleNamespace(id="lag", statistic=score)])
    search = found(BASE, BASE, rounds=[step])
    assert selection._with_own_numbers(search, lambda what: None).accepted is accepted
    assert (search.study == "its own") is accepted
    assert search.rounds[-1].options == ([mended] if accepted else [one])


def test_rivals_are_tried_again_that_lacked_no_more_than_later_effects_brought() -> None:
    first = taken(option("lag", excess=1000.0), option("slew", excess=3400.0), option("set", excess=3600.0))
    search = found(BASE, option("lag", "creep", excess=0.0), rounds=[first])  # creep brought 1000
    assert revision._earlier_rivals(search, 0) == ["slew"]
    assert revision._earlier_rivals(search, 1) == []


def test_the_best_of_a_round_is_tried_again_in_place_of_what_took_its_place() -> None:
    """A stop was behind a limit of stretch once instants were its own, and before it beside a lag of the electrodes."""
    search = two_effects()
    search.chosen = option("slew", "creep", excess=0.0, z_slow=0.0)
    assert revision._earlier_rivals(search, 0) == ["lag"]


def test_an_effect_without_which_next_to_nothing_is_lost_goes(monkeypatch: pytest.MonkeyPatch) -> None:
    for lost, stays in ((11.0, False), (13.0, True)):
        refits(
            monkeypatch,
            {(("creep",), ()): option("creep", excess=lost, z_slow=0.0), (("lag",), ()): option("lag", excess=1000.0)},
        )
        search = two_effects()
        revision.revise(search, lambda what: None)
        assert search.chosen.ids == (("lag", "creep") if stays else ("creep",))
        assert search.gains["lag"] == lost


def test_an_effect_that_stood_for_a_finer_form_of_a_later_one_goes(monkeypatch: pytest.MonkeyPatch) -> None:
    finer = option("creep", "lag", excess=0.0, z_slow=0.0, refined=("lag",))
    alone = option("lag", excess=5.0, z_slow=0.0, refined=("lag",))
    refits(
        monkeypatch,
        {
            (("lag",), ()): option("lag", excess=1000.0),
            (("creep",), ()): option("creep", excess=30_000.0),
            (("creep", "lag"), ("lag",)): finer,
            (("lag",), ("lag",)): alone,
        },
    )
    search = found(BASE, option("creep", "lag", excess=400.0))
    revision.revise(search, lambda what: None)
    assert search.chosen is alone


def test_a_finer_form_is_taken_where_the_record_asks_for_it(monkeypatch: pytest.MonkeyPatch) -> None:
    rival = option("set", excess=2100.0)

    def revised(coarse: Option, finer: Option, finer_rival: Option | None = None) -> Search:
        refits(monkeypatch, {(("lag",), ("lag",)): finer, (("set",), ("set",)): finer_rival})
        search = found(BASE, coarse, rivals=[rival], gains={"lag": 38_000.0})
        revision.revise(search, lambda what: None)
        return search

    coarse, finer = option("lag", excess=2000.0), option("lag", excess=100.0, refined=("lag",))
    assert revised(coarse, finer).chosen is finer
    assert revised(option("lag", excess=300.0, z_slow=4.0), finer).chosen is finer  # the plant's had made up for it
    assert revised(option("lag", excess=119.0, z_slow=4.0), finer).chosen.refined == ()
    search = found(BASE, option("set", excess=300.0, z_slow=4.0), gains={"set": 38_000.0})
    refits(monkeypatch, {(("set",), ("set",)): option("set", excess=0.0, refined=("set",))})
    revision.revise(search, lambda what: None)  # noise of the inputs would wear it
    assert search.chosen.refined == ()
    little = option("lag", excess=1981.0, refined=("lag",))  # 9.5 in log evidence
    assert revised(coarse, little).chosen is coarse
    enough = option("lag", excess=1979.0, refined=("lag",))
    assert revised(coarse, enough).chosen is enough
    denied = option("lag", excess=100.0, refined=("lag",), held_out=2000.0 + 0.05 * 1900.0 + 1.0)
    assert revised(coarse, denied).chosen is coarse
    best = option("set", excess=0.0, refined=("set",))  # a near rival gets its finer form too, and wins
    search = revised(coarse, finer, best)
    assert search.chosen is best
    assert search.rivals == [finer]
    assert search.gains == {"set": 38_000.0}


def test_far_from_the_plant_a_finer_form_of_a_rival_has_to_do_much_better(monkeypatch: pytest.MonkeyPatch) -> None:
    chosen, rival = option("lag", excess=5e5), option("set", excess=5.5e5)
    for left, wins in ((4.1e5, False), (3.8e5, True)):
        finer = option("set", excess=left, refined=("set",))
        refits(monkeypatch, {(("set",), ("set",)): finer})
        search = found(BASE, chosen, rivals=[rival], gains={"lag": 1e6})
        revision._refine_rivals(search, chosen, lambda what: None)
        assert search.chosen is (finer if wins else chosen)


def test_few_rivals_are_tried_and_refined(monkeypatch: pytest.MonkeyPatch) -> None:
    names = [f"rival{i}" for i in range(9)]
    catalogue = STUDY.catalogue | {
        n: SimpleNamespace(typical={n: 1.0}, parameters=[SimpleNamespace(name=n)], refine=("shape",)) for n in names
    }
    study = SimpleNamespace(catalogue=catalogue, plant=SimpleNamespace(places=[]), zero=lambda name: 0.0)
    rivals = [option(n, excess=2001.0 + i) for i, n in enumerate(names)]
    finer = option("lag", excess=100.0, refined=("lag",))
    asked = refits(monkeypatch, {(("lag",), ("lag",)): finer})
    search = found(BASE, option("lag", excess=2000.0), study=study, rivals=rivals, gains={"lag": 38_000.0})
    revision.revise(search, lambda what: None)
    assert sorted(asked[1:]) == [((n,), (n,)) for n in names[:4]]
    asked = refits(monkeypatch, {})
    chosen = option("lag", "creep", excess=0.0, z_slow=0.0)
    first = taken(option("lag", excess=1000.0), *rivals)
    search = found(BASE, chosen, study=study, rounds=[first, taken(chosen)], gains={"creep": 1000.0})
    revision.revise(search, lambda what: None)
    assert [ids for ids, _ in asked if ids[0] in names] == [(n, "creep") for n in names[:2]]


def test_the_least_supported_effect_is_withdrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    exact, vague = (
        SimpleNamespace(hard=(), off={name: off}, fit=(name,), parameters=[SimpleNamespace(name=name, minimum=None)])
        for name, off in (("lag", 0.0), ("creep", 1.0))
    )
    study = SimpleNamespace(
        catalogue={"lag": exact, "creep": vague}, plant=SimpleNamespace(places=[]), zero=lambda name: 0.0
    )
    both = option("lag", "creep")
    both = replace(both, fitted=replace(both.fitted, scaled=np.ones(3), covariance=0.01 * np.eye(3)))
    alone = option("lag", excess=50.0)
    search = found(BASE, both, gains={"lag": 11.0, "creep": 500.0})
    monkeypatch.setattr(
        judgement, "fitted_option", lambda study, ids, start, refined: alone if ids == ("lag",) else None
    )
    assert judgement._withdrawn(study, search, both) is alone  # creep's interval includes 1, whatever it gained
    assert search.rivals == [both]
    assert search.withdrawn == {"creep": "the interval of its size includes zero"}
    assert judgement._withdrawn(study, found(BASE, alone, gains={"lag": 9.0}), alone) is BASE


def test_few_rivals_are_looked_at_again_where_an_effect_is_withdrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple] = []
    monkeypatch.setattr(judgement, "fitted_option", lambda study, ids, start, refined: asked.append(ids))
    monkeypatch.setattr(judgement, "_vague", lambda work, found, described: {"creep": "it gains nothing"})
    rivals = [option(f"rival{i}", "creep", excess=10.0 * i) for i in range(9)]
    both = option("lag", "creep")
    assert judgement._withdrawn(None, found(BASE, both, rivals=rivals, gains={"creep": 5.0}), both) is BASE
    assert sorted(asked) == [("lag",), *((f"rival{i}",) for i in range(4))]


@pytest.mark.parametrize(("predicts", "taken"), [(1e5, ("slew", "offset")), (1e9, ("lag", "drift"))])
def test_a_pair_begins_elsewhere_where_two_effects_leave_far_more_than_noise(
    monkeypatch: pytest.MonkeyPatch, predicts: float, taken: tuple[str, ...]
) -> None:
    """Friction and an offset: alone each is behind a law that stands for both, and nothing follows from that one."""
    first = [option(n, excess=LARGE * (25 + i)) for i, n in enumerate(("lag", "stop", "slew", "set", "gain", "far"))]
    chosen = option("lag", "drift", excess=LARGE * 5, held_out=1e8)
    begun = []

    def pairs(study: object, one: Option, tell: object) -> list[Option]:
        begun.append(one.ids[0])
        pair = option("slew", "offset", excess=1000.0, held_out=predicts)
        return [pair] if one.ids == ("slew",) else [option(*one.ids, "drift", excess=LARGE * 20, held_out=1e9)]

    monkeypatch.setattr(selection, "_pairs_with", pairs)
    monkeypatch.setattr(selection, "own_nuisances", lambda study, one: ("its own", one))
    step = Round((), [], None, 30.0, first, True, "")
    search = found(BASE, chosen, rounds=[step], gains={"drift": LARGE})
    selection._begun_elsewhere(search, lambda what: None)
    assert begun == ["stop", "slew", "set", "gain"]  # what is chosen has had its turn
    assert search.chosen.ids == taken
    assert list(search.gains) == [taken[-1]]
    assert (search.study == "its own") is (taken == ("slew", "offset"))


@pytest.mark.parametrize(("behind", "taken"), [(4.0, ("offset",)), (60.0, ("stiffening", "set"))])
def test_one_effect_takes_the_place_of_two_if_it_explains_as_much_with_instants_of_its_own(
    monkeypatch: pytest.MonkeyPatch, behind: float, taken: tuple[str, ...]
) -> None:
    """With the base's switching instants another effect explains more, and a second one makes up for the rest."""
    chosen = option("stiffening", "set", excess=1000.0)
    first = [option("stiffening", excess=2e3), option("offset", excess=3e3), option("lag", excess=9e4)]
    base = option(excess=1e5)
    tried = []

    def alone(study: object, ids: tuple[str, ...], *_: object) -> Option:
        tried.append(ids)
        return option(*ids, excess=2e3)

    monkeypatch.setattr(selection, "fitted_option", alone)
    own = ("its own", option("offset", excess=1000.0 + behind))
    monkeypatch.setattr(selection, "own_nuisances", lambda study, one: own)
    search = found(base, chosen, rounds=[Round((), [], None, 30.0, first, True, "")])
    selection._one_instead(search, lambda what: None)
    assert tried == [("offset",)]  # the best has had its turn, and the lag is far behind
    assert search.chosen.ids == taken
    assert (search.study == "its own") is (taken == ("offset",))


@pytest.mark.parametrize(
    ("excess", "left", "better"),
    [(0.0, 0.0, True), (LARGE - 1.0, 0.0, False), (0.95 * LARGE, 0.0, False), (0.95 * LARGE, 900.0, True)],
)
def test_a_base_that_explains_as_much_where_the_choice_ended_takes_its_place(
    monkeypatch: pytest.MonkeyPatch, excess: float, left: float, better: bool
) -> None:
    """What leads a fit out of a local minimum is no effect; a base that is hardly better there is none, and where the
    effect leaves noise alone it has to be much better."""
    again = option(excess=excess)
    monkeypatch.setattr(selection, "fitted_option", lambda study, ids, start, refined: again)
    chosen = option("lag", excess=left, z_slow=9.0 * (left > 0))
    deeper = selection.base_from_choice(found(option(excess=LARGE), chosen))
    assert deeper is (again.fitted if better else None)


def test_no_rival_is_settled_that_what_was_fitted_leaves_far_behind() -> None:
    """A start that was taken at the base spoiled a held-out experiment of all; three hopeless rivals took a minute."""
    before = option("line", excess=1000.0, held_out=6e5)
    search = found(option(excess=LARGE, held_out=6e5), option("line", excess=900.0))
    hopeless, near = (option("stop", excess=e * LARGE, held_out=5e4) for e in (0.9, 0.1))
    assert [selection._may_pass(search, before, r, 598100.0) for r in (hopeless, near)] == [False, True]


@pytest.mark.parametrize(("behind", "settled"), [(0.0, True), (20.0, False)], ids=["as well", "worse"])
def test_what_fitted_as_well_is_settled_whatever_held_out_experiments_said(
    monkeypatch: pytest.MonkeyPatch, behind: float, settled: bool
) -> None:
    """A delay of the laser and one of the command; the start of a held-out experiment belonged to another model, and
    one of them was "distinguished from every rival"."""
    before, rival = option("lag", excess=1000.0), option("slew", excess=1000.0 + behind, held_out=9e3)
    numbers_taken = []

    def own_nuisances(study: Any, one: Option) -> tuple[Any, Option]:
        numbers_taken.append(one.ids)
        return study, option(*one.ids)

    monkeypatch.setattr(selection, "own_nuisances", own_nuisances)
    rounds = [
        replace(Round((), [], None, 30.0, [before, rival], True, ""), scores=[SimpleNamespace(id="lag", statistic=9.0)])
    ]
    search = found(BASE, before, rivals=[rival], rounds=rounds)
    selection._settle(search, BASE, lambda what: None)
    assert numbers_taken == [("lag",), ("slew",)][: 1 + settled]
    assert search.rivals[0].held_out == pytest.approx(2000.0 if settled else 9e3)


def test_no_base_is_sought_where_nothing_was_chosen() -> None:
    """Without a choice there is no other place to begin at."""
    assert selection.base_from_choice(found(BASE, BASE)) is None


@pytest.mark.parametrize(
    ("left", "parameters", "tried"), [(900.0, 2, True), (900.0, 3, False), (0.0, 2, False)], ids=["", "bends", "clean"]
)
def test_a_simpler_law_is_settled_where_the_choice_is_not_all(left: float, parameters: int, tried: bool) -> None:
    """A law that bends more fits better with others' zeros; what is behind by up to a tenth may be before it."""
    before = option("relaxation", excess=1000.0, parameters=3)
    search = found(option(excess=LARGE), option("relaxation", excess=left, z_slow=9.0 * (left > 0)))
    behind = option("leak", excess=4000.0, parameters=parameters)
    assert selection._may_pass(search, before, behind, 50.0) == tried


@pytest.mark.parametrize(
    ("size", "rival", "behind", "chosen"),
    [(6.0, 1.0, 10.0, "slew"), (4.0, 1.0, 10.0, "lag"), (6.0, 2.0, 10.0, "lag"), (6.0, 1.0, 200.0, "lag")],
)
def test_an_effect_of_unusual_size_gives_way_to_an_equivalent_of_usual_size(
    size: float, rival: float, behind: float, chosen: str
) -> None:
    """A mass of sixty tubes is named only where no delay of a usual length explains as much; a wall that loses heat by
    radiation had a dependence of unusual size, and a store that overflows explained 1.5 % less."""
    first, other = option("lag", excess=0.0, z_slow=0.0), option("slew", excess=behind, z_slow=0.0)
    first.fitted.values["lag"], other.fitted.values["slew"] = size, rival
    search = found(BASE, first, rivals=[other], gains={"lag": 13000.0})
    revision.with_usual_sizes(search)
    assert search.chosen.ids == (chosen,)
    assert [r.ids for r in search.rivals] == [("lag",) if chosen == "slew" else ("slew",)]
    assert search.gains == {chosen: 13000.0 - (10.0 if chosen == "slew" else 0.0)}


@pytest.mark.parametrize(
    ("behind", "impossible", "chosen"), [(200.0, (), "slew"), (300.0, (), "lag"), (9.0, ("slew",), "lag")]
)
def test_an_effect_that_cannot_be_gives_way_to_one_that_may(
    behind: float, impossible: tuple[str, ...], chosen: str
) -> None:
    """A leak was an overflow at a level that no record reached, which explained a ten thousandth more: unexplained."""
    first = replace(option("lag", excess=0.0, z_slow=0.0), unreached=("lag",))
    other = replace(option("slew", excess=behind), pinned=impossible)
    search = found(BASE, first, rivals=[other], gains={"lag": 13000.0})
    revision.with_usual_sizes(search)
    assert search.chosen.ids == (chosen,)


@pytest.mark.parametrize(
    ("behind", "ended", "chosen"),
    [
        (10.0, False, "lag"),
        (-300.0, False, "lag"),
        (14.0, False, "slew"),
        (200.0, True, "lag"),  # a friction that creeps by less than anybody sees is dry
        (300.0, True, "slew"),
    ],
)
def test_a_limit_of_an_effect_takes_its_place_where_it_explains_as_much(
    monkeypatch: pytest.MonkeyPatch, behind: float, ended: bool, chosen: str
) -> None:
    """A lag of 15 ms of a valve was a resonance with a damping of 8: the lag alone had ended at another optimum."""
    entries = {
        n: SimpleNamespace(**vars(e), limits=("lag",) if n == "slew" else ()) for n, e in STUDY.catalogue.items()
    }
    entries["lag"].shapes = {"lag": (0.5, 1.0)}
    first, other = option("slew", excess=0.0, z_slow=0.0), option("lag", excess=behind)
    search = found(BASE, first, gains={"slew": 13000.0})
    search.study = SimpleNamespace(catalogue=entries)
    begun: list[list[dict[str, float]]] = []

    def from_starts(study: object, ids: tuple, starts: list[dict[str, float]], refined: tuple) -> object:
        begun.append(starts)
        return other.fitted

    monkeypatch.setattr(revision, "best_of_starts", from_starts)
    monkeypatch.setattr(revision, "iterated", lambda study, one: (study, one))
    monkeypatch.setattr(revision, "at_bounds", lambda effect, fitted: {"slew": -1} if ended else {})
    refits(monkeypatch, {(("lag",), ()): other})
    revision.with_limits(search, lambda what: None)
    assert search.chosen.ids == (chosen,) and [[s["lag"] for s in starts] for starts in begun] == [[0.5, 1.0]]
    assert search.gains == {chosen: 13000.0 - (behind if chosen == "lag" else 0.0)}


def test_where_no_effect_is_left_the_search_begins_anew_from_the_base_they_led_to(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A delay led a base of a null's recordings out of a local optimum, an average after it made the delay vain, and
    without either the base fitted as well: a refit has nothing to be settled with."""
    better = replace(BASE, fitted=replace(BASE.fitted, cost=0.0))
    bases: list[object] = []

    def round_of(study: object, base: Option, *_: object) -> Round:
        bases.append(base)
        step = taken(option("lag", excess=0.0))
        return replace(step, accepted=len(bases) == 1)

    def revised(search: Search, tell: object) -> None:
        search.chosen = better

    monkeypatch.setattr(selection, "option", lambda study, ids, fitted: replace(BASE, fitted=fitted))
    monkeypatch.setattr(selection, "take_round", round_of)
    monkeypatch.setattr(selection, "with_declared_starts", lambda found, step, tell: step)
    monkeypatch.setattr(selection, "_better_base", lambda *_: None)
    monkeypatch.setattr(selection, "_with_own_numbers", lambda found, tell: found.rounds[-1])
    monkeypatch.setattr(selection, "_converged", lambda study, one, tell: one)
    monkeypatch.setattr(selection, "revise", revised)
    search = selection.forward_selection(STUDY, BASE.fitted, 0.0, 1, lambda what: None)
    assert search.chosen.ids == () and search.base.fitted is better.fitted
    assert [b.fitted for b in bases] == [BASE.fitted, better.fitted]


@pytest.mark.parametrize(("known", "kept"), [(True, ("lag", "creep")), (False, ("creep",))])
def test_two_effects_that_became_one_are_reconsidered(
    monkeypatch: pytest.MonkeyPatch, known: bool, kept: tuple[str, ...]
) -> None:
    """An echo after 60 ms of nine tenths, and a delay of 60 ms with which it may be any part: the delay is enough."""
    monkeypatch.setattr(revision, "bounded_away", lambda effect, fitted: known)
    refits(monkeypatch, {(("creep",), ()): option("creep", excess=1.0), (("lag",), ()): option("lag", excess=5e4)})
    search = found(BASE, option("lag", "creep", excess=0.0))
    revision.reconsider(search)
    assert search.chosen.ids == kept
