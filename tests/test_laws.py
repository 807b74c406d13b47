"""Every law at every kind of place: off it is the base, on it shows, its units fit, C, Python and tangents agree."""

from __future__ import annotations

from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

from dimensions import mismatches
from tubular_dea.discover.scores.parameters import unusual
from tubular_dea.emit.python import compile_python
from tubular_dea.kernel import Kernel
from tubular_dea.laws import Balance, Coefficient, Path, effects_at, seconds
from tubular_dea.laws.places import laws
from tubular_dea.model.build import Build
from tubular_dea.model.declare import DeclarationError, Model
from tubular_dea.model.effect import Effect, added
from tubular_dea.model.scales import at_first
from tubular_dea.plants.plant import Input, Output, Plant
from tubular_dea.plants.tube import PLANT as TUBE
from tubular_dea.protocol import Protocol


def oscillator() -> Model:
    """A mass on a spring with a damper, pushed; the output feels the rate of the push too."""
    m = Build("Oscillator", "A mass on a spring")
    force = m.input("force", "N", nominal=2.0)
    mass, c, k = m.parameter("mass", "kg", 0.5), m.parameter("c", "N.s/m", 1.0), m.parameter("k", "N/m", 20.0)
    cable = m.parameter("cable", "m.s/N", 1e-3)
    x = m.state("x", "m", start="free", nominal=0.1)
    v = m.state("v", "m/s", nominal=0.7)
    spring = m.define("spring", "N", k * x)
    m.derivative(x, v)
    m.derivative(v, (force - c * v - spring) / mass)
    m.output("position", "m", x + cable * m.rate(force), nominal=0.1)
    return m.model()


def tanks() -> Model:
    """Two tanks in a row."""
    m = Build("Tanks", "Two tanks in a row")
    pump = m.input("pump", "V", nominal=5)
    k1, k2, gain = m.parameter("k1", "1/s", 0.5), m.parameter("k2", "1/s", 0.4), m.parameter("gain", "m/V/s", 0.02)
    upper, lower = m.state("upper", "m", start="shared", nominal=0.2), m.state("lower", "m", start=0.1, nominal=0.2)
    q1, q2 = m.define("flow_1", "m/s", k1 * upper), m.define("flow_2", "m/s", k2 * lower)
    m.derivative(upper, gain * pump - q1)
    m.derivative(lower, q1 - q2)
    m.output("level", "m", lower)
    return m.model()


def sensor() -> Model:
    """A static law: no state at all."""
    m = Build("Sensor", "A bridge and its supply")
    load, supply = m.input("load", "N", nominal=100.0), m.input("supply", "V", nominal=10.0)
    gain = m.parameter("gain", "1/N", 1e-5)
    strain = m.define("strain", "1", gain * load)
    m.output("bridge", "V", strain * supply)
    return m.model()


PLACES = {
    "oscillator": (
        oscillator,
        (
            Path("force"),
            Balance("v", displacement="x"),
            Coefficient("spring", of="x"),
            Coefficient("c", of="v"),
            Path("position", of="v"),
        ),
    ),
    "tanks": (
        tanks,
        (
            Path("pump", of="lower"),
            Balance("upper", below="lower"),
            Balance("lower"),
            Coefficient("flow_1", of="upper"),
            Path("level"),
        ),
    ),
    "sensor": (sensor, (Path("load", of="supply"), Coefficient("strain", of="supply"), Path("bridge", of="load"))),
}
DRIVES = {
    "oscillator": Protocol.of([0, 0.3, 0.5, 0.7, 1.2, 1.4, 3], force=[0, 2.5, 2.5, -2, -2, 1, 3]),
    "tanks": Protocol.of([0, 3, 3, 8, 8, 20], pump=[8, 8, 2, 2, 6, 6]),
    "sensor": Protocol.of([0, 1, 2, 3], load=[0, 150, -120, 30], supply=[10, 10, 11, 10]),
}
CASES = [(plant, i) for plant, (_, places) in PLACES.items() for i in range(len(places))]


@cache
def at(plant: str, place: int) -> tuple[Effect, ...]:
    make, places = PLACES[plant]
    return tuple(effects_at(make(), places[place]))


LAWS = [(plant, place, i) for plant, place in CASES for i in range(len(at(plant, place)))]


def named(case: tuple[str, int, int]) -> str:
    return at(case[0], case[1])[case[2]].id


@cache
def kernel_of(plant: str, place: int | None = None) -> Kernel:
    """The plant with every law at a place in it (and off)."""
    model = PLACES[plant][0]()
    for effect in at(plant, place) if place is not None else ():
        model = effect(model)
    return Kernel(model)


def run(plant: str, place: int | None = None, values: dict[str, float] | None = None, **more) -> np.ndarray:
    drive = DRIVES[plant]
    kernel = kernel_of(plant, place)
    times = np.linspace(0, drive.time[-1], 201)
    return kernel.simulate(drive, times, values, tolerance=1e-9, **more)[kernel.outputs[0]]


def shown(effect: Effect) -> dict[str, float]:
    """Values at which the law has its usual size in these records: ends and levels where the records come to."""
    levels = [n for n in effect.shapes if n.endswith(("range", "level"))]
    return dict(effect.typical) | {n: effect.shapes[n][2] for n in levels}


def test_every_law_is_here() -> None:
    seen = {effect.id.split("(")[0] for plant, place in CASES for effect in at(plant, place)}
    assert seen == set(laws())


@pytest.mark.parametrize("case", LAWS, ids=named)
def test_declaration(case: tuple[str, int, int]) -> None:
    effect = at(case[0], case[1])[case[2]]
    model = effect(PLACES[case[0]][0]())
    assert model.effects == (effect.id,)
    assert {q.name for q in effect.parameters} == set(effect.typical)
    assert effect.off and effect.fit and effect.amplitudes
    for line in ("Equation", "Source:", "Typical:", "::"):
        assert line in effect.documentation, f"{effect.id}'s text lacks '{line}'"
    for q in effect.parameters:
        assert q.name.isidentifier() and q.source and q.description
        for value in (effect.off.get(q.name, q.value), effect.typical[q.name], *effect.shapes.get(q.name, ())):
            assert q.minimum <= value <= q.maximum, f"{q.name} = {value} is outside its own bounds"
    assert any(effect.typical[n] != value for n, value in effect.off.items()), f"{effect.id} is off where it is typical"
    assert mismatches(model) == []


def test_a_law_is_only_where_it_can_be_told_from_others() -> None:
    """What a state drives has its relaxing branch in the balance, and no valve in front of it."""
    model, place = tanks(), Coefficient("flow_1", of="upper")
    assert not {"relaxation(flow_1)", "orifice(flow_1)"} & {e.id for e in effects_at(model, place)}
    assert {"relaxation(strain)", "orifice(strain)"} <= {e.id for e in at("sensor", 1)}


def valve(start: float | str, spool: bool) -> tuple[Model, Effect]:
    """A cylinder behind a valve, whose spool may follow its command late; its orifice."""
    m = Build("Cylinder")
    command = m.input("command", "1", nominal=0.5)
    lag = m.parameter("lag", "s", 0.005, tunable=False)
    full, stiff = m.parameter("full", "Pa/s", 1e9, minimum=1.0), m.parameter("stiff", "1/s", 20.0, minimum=0.1)
    pressure = m.state("pressure", "Pa", start=start, nominal=3e6)
    opened = m.state("opened", "1", nominal=0.5) if spool else command
    flow = m.define("flow", "Pa/s", full * opened)
    if spool:
        m.derivative(opened, (command - opened) / lag)
    m.derivative(pressure, flow - stiff * pressure)
    m.output("load", "Pa", pressure)
    model = m.model()
    return model, {e.id: e for e in effects_at(model, Coefficient("flow", of="pressure"))}["orifice(flow)"]


@pytest.mark.parametrize("spool", [False, True])
@pytest.mark.parametrize("start", [0.0, "free", 1e6])
def test_an_orifice_counts_its_load_from_nothing(start: float | str, spool: bool) -> None:
    """Not from half of its nominal value, where a free start is declared, nor from the load that it starts under."""
    model, effect = valve(start, spool)
    kernel, time = Kernel(effect(model)), np.linspace(0, 1, 11)
    ends = []
    for sign in (1.0, -1.0):
        values = dict(effect.typical) | ({"pressure_start": 0.0} if start == "free" else {})
        ends.append(kernel.simulate(Protocol(time[[0, -1]], {"command": np.full(2, sign * 0.5)}), time, values)["load"])
    assert ends[0][-1] == pytest.approx(-ends[1][-1], rel=1e-6)


def test_what_warms_up_does_so_as_one_body() -> None:
    """A coil's resistance beside its current: 1 - exp(-t / tau) after a step of what warms it."""
    effect = next(e for e in at("sensor", 1) if e.id == "warming(strain)")
    kernel, time = Kernel(effect(sensor())), np.linspace(0, 5, 11)
    drive = Protocol.of([0, 1, 1, 5], load=[100] * 4, supply=[0, 0, 10, 10])
    values = {"strain_warming_rise": 0.3, "strain_warming_tau": 1.7}
    expected = np.where(time < 1, 0, 1e-2 * (1 + 0.3 * (1 - np.exp(-(time - 1) / 1.7))))
    np.testing.assert_allclose(kernel.simulate(drive, time, values, 1e-9)["bridge"], expected, atol=1e-9)


def test_an_absolute_pressure_loads_an_orifice_from_that_of_the_air() -> None:
    model, effect = valve(1e5, spool=False)
    assert float(effect(model).expression("flow_orifice_start")) == 1e5


def test_a_lead_is_where_inputs_that_move_have_rates() -> None:
    """Not where the model has the rate already, nor where a state or what is held between samples moves the signal."""
    found = {e.id for plant, place in CASES for e in at(plant, place) if e.id.startswith("lead(")}
    assert found == {"lead(pump)", "lead(load)", "lead(strain)"}
    assert "lead(strain)" not in {e.id for e in effects_at(sensor(), Coefficient("strain"), held=["load"])}
    assert "lead(strain)" in {e.id for e in effects_at(sensor(), Coefficient("strain"), held=["supply"])}


def test_a_lead_along_a_ramp_is_the_signal_later() -> None:
    """On a ramp, once the short time is over, a lead of 0.2 s is the signal 0.2 s later."""
    (effect,) = effects_at(sensor(), Coefficient("strain", laws=("lead",)))
    run = Kernel(effect(sensor())).simulate(
        Protocol.of([0, 1, 4], load=[0, 0, 300], supply=[10, 10, 10]),
        np.array([2.0, 3.0]),
        {"strain_lead": 0.2, "strain_lead_tau": 0.01},
    )
    assert run["bridge"] == pytest.approx([10 * 1e-5 * 120, 10 * 1e-5 * 220], rel=1e-6)


@pytest.mark.parametrize(
    ("unit", "moves"), [("m/s", True), ("mm/s", True), ("rad/s", True), ("K", False), ("1/s", False)]
)
def test_a_speed_without_a_displacement_has_friction_and_no_overflow(unit: str, moves: bool) -> None:
    m = Build("Wheel", "A motor on a wheel")
    current = m.input("current", "A", nominal=2.0)
    push = m.parameter("push", f"{unit}/s/A" if unit != "1/s" else "1/s2/A", 1.0)
    w = m.state("w", unit, nominal=0.3)
    m.derivative(w, push * current - w * m.parameter("drag", "1/s", 2.0))
    m.output("speed", unit, w)
    found = {e.id: e for e in effects_at(m.model(), Balance("w"))}
    assert ({"dry_friction(w)", "quadratic_drag(w)"} <= {*found}) == moves
    assert ("spill_over(w)" in found) != moves
    assert not {"stop(w)", "quadratic(w)", "hysteresis(w)"} & {*found}
    if moves:
        assert mismatches(found["dry_friction(w)"](m.model())) == []


def test_what_leaks_into_the_store_below_arrives_there() -> None:
    """Two stores that nothing else fills or empties: their sum stays, and their difference goes twice as fast."""
    (effect,) = effects_at(tanks(), Balance("upper", below="lower", laws=("exchange",)))
    model, times = effect(tanks()), np.linspace(0, 5, 51)
    values = {"k1": 0.0, "k2": 0.0, "upper_start": 0.3, "upper_exchange": 0.25}
    run = Kernel(model).simulate(Protocol.of([0, 5], pump=[0, 0]), times, values, tolerance=1e-10)
    assert run["level"] == pytest.approx(0.2 - 0.1 * np.exp(-0.5 * times), rel=1e-7)
    with pytest.raises(DeclarationError, match="exchange cannot act there: it needs a store"):
        effects_at(tanks(), Balance("lower", laws=("exchange",)))


def test_the_check_of_dimensions_can_fail() -> None:
    model = tanks()
    assert mismatches(model) == []
    assert mismatches(model.replace("flow_1", model["k1"] * model["pump"]))
    assert mismatches(model.drive("upper", model["flow_1"] + model["upper"]))


@pytest.mark.parametrize(("plant", "place"), CASES)
def test_off_is_the_base_over_time(plant: str, place: int) -> None:
    effects = at(plant, place)
    shaped = {n: v for e in effects for n, v in (dict(e.typical) | dict(e.off)).items()}
    base = run(plant)
    assert np.max(np.abs(run(plant, place, shaped) - base)) < 1e-7 * np.max(np.abs(base))


POSITIVE = ("rectification", "one_way")  # laws of what is negative, which nothing in the tanks is
SHOWING = [c for c in LAWS if not (c[0] == "tanks" and named(c).startswith(POSITIVE))]


@pytest.mark.parametrize("case", SHOWING, ids=named)
def test_on_it_shows(case: tuple[str, int, int]) -> None:
    plant, place, i = case
    base = run(plant)
    seen = run(plant, place, shown(at(plant, place)[i]))
    assert np.all(np.isfinite(seen))
    assert np.max(np.abs(seen - base)) > 2e-4 * np.max(np.abs(base))


@pytest.mark.parametrize("case", LAWS, ids=named)
def test_tangents_are_what_differences_say(case: tuple[str, int, int]) -> None:
    """Derivatives to every parameter of the law, halfway on, over one mesh."""
    plant, place, i = case
    effect, kernel, drive = at(plant, place)[i], kernel_of(plant, place), DRIVES[plant]
    on = shown(effect)
    values = on | {n: 0.5 * (off + on[n]) for n, off in effect.off.items()}
    values |= {q.name: 0.1 * (q.maximum or 1) for q in effect.parameters if values[q.name] == q.minimum}
    names, output = [q.name for q in effect.parameters], kernel.outputs[0]
    times, mesh = np.linspace(0, drive.time[-1], 101), kernel.mesh(drive, values, 1e-9)
    found = kernel.simulate(drive, times, values, sensitivities=names, mesh=mesh)
    scale = np.max(np.abs(found[output]))
    for j, q in enumerate(effect.parameters):
        step = 1e-5 * (abs(values[q.name]) or q.nominal)
        moves = any(d.by == q.name for d in kernel.model.delays) or not kernel.states  # a delay moves the mesh
        over = {"tolerance": 1e-11} if moves else {"mesh": mesh}
        up, down = (kernel.simulate(drive, times, values | {q.name: values[q.name] + s}, **over) for s in (step, -step))
        ours, theirs = found.sensitivities[output][:, j] * step, (up[output] - down[output]) / 2
        wrong = np.abs(ours - theirs) > 1e-3 * np.max(np.abs(theirs)) + 2e-10 * scale
        assert np.mean(wrong) < 0.05, f"{q.name}: {ours[wrong][:3]} and {theirs[wrong][:3]}"  # kinks are passed between


@pytest.mark.parametrize(("plant", "place"), CASES)
def test_c_and_python_agree(plant: str, place: int) -> None:
    kernel, model = kernel_of(plant, place), kernel_of(plant, place).model
    python = compile_python(model)
    rng = np.random.default_rng(3)
    values = {n: v for e in at(plant, place) for n, v in shown(e).items()}
    p = tuple(kernel.parameters(values))
    late = [d.of for d in model.delays]
    for _ in range(5):
        x = np.array([s.quantity.nominal for s in model.states]) * rng.uniform(-1.5, 1.5, len(model.states))
        u = {q.name: q.nominal * rng.uniform(-1.5, 1.5) for q in model.inputs}
        us = (*u.values(), *(u.get(of, 0.0) for of in late))
        theirs = python.derivatives(0.0, tuple(x), us, (0.0,) * len(us), p, ())
        ours = kernel.derivatives(x, np.array(list(u.values())), values)
        assert ours == pytest.approx(np.array(theirs), rel=1e-9, abs=1e-12)


def test_a_diode_keeps_the_current_of_a_coil_at_zero() -> None:
    """Between pushes the source would draw the coil below zero; then the current waits there, and rises from there."""
    m = Build("Coil", "A coil at a source")
    source = m.input("source", "V", nominal=10)
    coil, r = m.parameter("coil", "H", 1e-2), m.parameter("r", "ohm", 2.0)
    i = m.state("i", "A", nominal=5)
    m.derivative(i, (source - r * i) / coil)
    m.output("current", "A", i)
    (effect,) = (e for e in effects_at(m.model(), Balance("i")) if e.id == "one_way(i)")
    kernel = Kernel(effect(m.model()))
    drive = Protocol.of([0, 0.02, 0.02, 0.06, 0.06, 0.08], source=[10, 10, -10, -10, 10, 10])
    times = np.linspace(0, 0.08, 401)
    free, held = (kernel.simulate(drive, times, {"i_one_way_part": p}, tolerance=1e-9)["current"] for p in (0.0, 1.0))
    corner = 1e-3 * 5
    assert free.min() < -4.9
    assert -1.001 * corner < held.min() < 0
    up = 5 * (1 - np.exp(-0.02 * 2 / 1e-2))
    assert held[times <= 0.02][-1] == pytest.approx(up, abs=1e-7)  # above the level nothing acts
    assert held[-1] == pytest.approx(up, abs=corner)


def test_a_law_goes_by_the_plants_own_names() -> None:
    place = Path("level", channel="sensor", names={"lag": "sensor_lag", "lag.tau": "tau_sensor"}, laws=("lag",))
    (effect,) = effects_at(tanks(), place)
    assert effect.id == "sensor_lag" and effect.channel == "sensor"
    assert [q.name for q in effect.parameters] == ["tau_sensor", "sensor_lag_share"]


@pytest.mark.parametrize(
    ("place", "words"),
    [
        (
            Path("pumpe"),
            "Path('pumpe'): expected an input, or an output that is a definition but was given 'pumpe'; did",
        ),
        (Path("upper"), "Path('upper'): expected an input, or an output that is a definition but was given 'upper'"),
        (Balance("flow_1"), "Balance('flow_1'): expected a state but was given 'flow_1', a definition"),
        (
            Balance("upper", below="pump"),
            "Balance('upper', below='pump'): expected a state but was given 'pump', an input",
        ),
        (
            Balance("upper", displacement="lower"),
            "expected a displacement whose rate is in 'm', as upper is; lower is in",
        ),
        (
            Coefficient("lower"),
            "Coefficient('lower'): expected a definition or a parameter but was given 'lower', a state",
        ),
        (Coefficient("flow_1", of="flow_2"), "expected an input, a state or a definition before flow_1 but was given"),
        (Balance("upper", laws=("stop",)), "the law stop cannot act there: it needs a `displacement`"),
        (Path("pump", laws=("stop",)), "the law stop cannot act there"),
        (Path("pump", laws=("stopp",)), "there is no law 'stopp'; did you mean stop?"),
        (Path("pump", laws="gain"), "Path('pump'): laws: expected a list of names, as ['gain'], but was given a text"),
        (Path("pump", seconds="fast"), "Path('pump'): seconds: expected a positive number but was given 'fast'"),
        (Path("pump", seconds=-1), "Path('pump'): seconds: expected a positive number but was given -1"),
        (Balance("upper", size=0.0), "Balance('upper'): size: expected a positive number but was given 0.0"),
        (Path("level", delayed=True), "Path('level'): delayed: expected an input"),
    ],
)
def test_a_wrong_place_says_what_was_expected(place, words: str) -> None:
    with pytest.raises(DeclarationError) as problem:
        effects_at(tanks(), place)
    assert words in str(problem.value)


def test_laws_of_a_temperature_count_from_where_it_starts() -> None:
    """From 0 K, a factor that goes with a temperature would change all parameters at rest, and a gain the zero."""
    m = Build("Foil", "A foil in air, heated")
    volts, air, loss = m.input("volts", "V"), m.parameter("air", "K", 295.0), m.parameter("loss", "1/s", 0.5)
    heats = m.parameter("heats", "K/s/V^2", 0.1)
    foil = m.state("foil", "K", start=air, nominal=330)
    power = m.define("power", "K/s", heats * volts**2)
    m.derivative(foil, power - loss * (foil - air))
    m.output("reading", "K", foil)
    model, time = m.model(), np.array([0.0, 0.01])
    named = {e.id: e for place in (Coefficient("power", of="foil"), Path("reading")) for e in effects_at(model, place)}
    assert "orifice(power)" not in named
    for name in ("dependence(power)", "gain(reading)"):
        effect = named[name]
        kernel = Kernel(effect(model))
        heated = Protocol(time, {"volts": np.full(2, 10.0)})
        base, there = (
            kernel.simulate(heated, time, dict(values))["reading"] for values in (effect.off, effect.typical)
        )
        assert there[0] == 295.0
        assert there[1] - 295.0 == pytest.approx(base[1] - 295.0, rel=0.031)
        assert there[1] != base[1]


def test_an_instrument_as_slow_as_the_plant_is_unusual() -> None:
    """Whether a lag makes it so, or a resonance by its damping, unless it is said how fast instruments are there."""
    model = tanks()
    slow = 0.5 * seconds(model)
    values = {"level_lag_tau": slow, "level_resonance_omega": 40 / slow, "level_resonance_damping": 20.0}
    fitted = SimpleNamespace(names=list(values), values=values)

    def sizes(declared: float | None) -> list[float]:
        found = {e.id: e for e in effects_at(model, Path("level", seconds=declared))}
        return [unusual(found[name], fitted) for name in ("lag(level)", "resonance(level)")]

    assert sizes(None) == pytest.approx([10.0, 10.0])
    assert sizes(2 * slow)[0] == pytest.approx(1.0)


def test_a_wall_may_be_as_hard_as_it_likes() -> None:
    """It stands before a limit of the elastomer's stretch of 22 Pa, which was said in place of a hard housing."""
    stop, gent = (TUBE.catalogue[name] for name in ("rigid_stop", "strain_stiffening"))
    hard = {"stop_stiffness": 400 * stop.typical["stop_stiffness"], "lambda_2_stop": 1.18}
    limit = {"mu_gent": 2 * gent.typical["mu_gent"], "J_m": gent.typical["J_m"]}
    assert unusual(stop, SimpleNamespace(names=list(hard), values=hard)) < 1
    assert unusual(gent, SimpleNamespace(names=list(limit), values=limit)) == pytest.approx(2.0)


def test_the_force_of_what_is_moved_takes_work_where_a_part_of_its_play_is_negative() -> None:
    """Of a static law from displacement to force, a negative part of play is friction: each cycle takes work."""
    m = Build("Strip", "A spring that is pulled")
    pull = m.input("pull", "m", nominal=0.02)
    m.output("force", "N", m.define("tension", "N", m.parameter("k", "N/m", 100.0) * pull))
    effect = next(e for e in effects_at(m.model(), Path("pull")) if e.id == "hysteresis(pull)")
    part, width = (q.name for q in effect.parameters)
    assert next(q for q in effect.parameters if q.name == part).minimum == -1.0
    kernel, time = Kernel(effect(m.model())), np.linspace(0.0, 400.0, 4001)  # slowly: the follower is dragged at once
    x = 0.01 * np.sin(2 * np.pi * time / 200)

    def work(value: float) -> float:
        answer = kernel.simulate(Protocol(time, {"pull": x}), time, {part: value, width: 1e-3})
        last = time >= 200.0
        return float(np.trapezoid(answer["force"][last], x[last]))

    loop = 0.2 * 100.0 * 4 * 1e-3 * (0.01 - 1e-3)  # a parallelogram: twice its half height times its width
    assert work(-0.2) == pytest.approx(loop, rel=0.05)
    assert work(0.2) == pytest.approx(-loop, rel=0.05)


def test_an_unknown_start_of_a_temperature_is_its_usual_value() -> None:
    """A heater that others measured: a dependence counted from 160 K, half of what is usual, and the heat transfer, as
    the plant's parameter there, was known to eleven decades."""
    build = Build("Heater", "A heated board", "A lump.")
    rate = build.parameter("rate", "1/s", 0.006, minimum=0)
    air, full = build.parameter("air", "K", 296.0, minimum=250), build.parameter("full", "m", 2.0)
    board = build.state("board", "K", start="free", nominal=320.0, minimum=200.0)
    level = build.state("level", "m", start="free", nominal=2.0, minimum=1.0)
    build.derivative(board, rate * (air - board))
    build.derivative(level, rate * (full - level))
    build.output("reading", "K", board)
    model = build.model()
    assert model.quantity("board_start").value == at_first(model, "board") == 320.0
    assert model.quantity("level_start").value == 2.0


def test_a_dependence_on_a_temperature_counts_from_its_usual_value() -> None:
    """At 0 K a load cell's gain was 2.7 mV/N, so that it is 1.1 mV/N at 300 K."""
    m = Build("Cell", "A load cell", "A load cell.")
    load, temperature = m.input("load", "N", nominal=100.0), m.input("temperature", "K", nominal=300.0)
    gain = m.parameter("gain", "V/N", 1.1e-3)
    m.output("bridge", "V", gain * load + 0 * temperature, "Amplified bridge")
    cell = Plant(
        m.model(), [Input("load"), Input("temperature")], [Output("bridge")], [Coefficient("gain", of="temperature")]
    )
    effect = cell.catalogue["dependence(gain)"]
    protocol = Protocol.of([0, 1], load=[100, 100], temperature=[300, 300])
    (slope,) = effect.typical
    read = Kernel(added(cell.model, [effect])).simulate(protocol, [1.0], {slope: 0.003})["bridge"]
    assert read == pytest.approx(0.11)


def test_usual_times_of_a_plant_that_has_none_at_its_start_are_those_at_work() -> None:
    m = Build("Tank", "A tank", "A tank.")
    valve, level = m.input("valve", "1", nominal=1.0), m.state("level", "m", nominal=1.0)
    flow = m.parameter("flow", "1/s", 0.02)
    m.derivative(level, -flow * valve * level)
    m.output("reading", "m", level)
    assert seconds(m.model()) == pytest.approx(50.0)
