r"""The silverbox: an electronic circuit that behaves as a mass on a spring with a damper.

::

    force [V]      displacement [V]
      ------> [ mass ] ------>
              |      |
     stiffness [=]  [|] damping
              |______|
              ////////

Equations: d(position)/dt = velocity, d(velocity)/dt = gain force - damping velocity - stiffness position; displacement
= position. Both signals are voltages, 610.35 samples a second, band-limited between samples; each record has zeros of
its own.

Citation: T. Wigren, J. Schoukens, "Three free data sets for development and benchmarking in nonlinear system
identification", ECC 2013, 2933-2938. What these equations lack: the spring hardens with the third power.

Usage::

    tubular-dea close-loop DATA --plant cosim_examples/plants/silverbox.py --out OUT
"""

from tubular_dea.plants import Balance, Build, Input, Output, Path, Plant

m = Build("Silverbox", "An electronic mass on a spring", __doc__ or "")
force = m.input("force", "V", "Voltage for the force", nominal=0.1)
gain = m.parameter("gain", "1/s2", 1.9e5, "Acceleration for a volt of force", minimum=1e2)
damping = m.parameter("damping", "1/s", 40.0, "Damping over mass", minimum=0.1)
stiffness = m.parameter("stiffness", "1/s2", 1.9e5, "Stiffness over mass", minimum=1e3)
position = m.state("position", "V", "Voltage for the displacement", start="free", nominal=0.1)
velocity = m.state("velocity", "V/s", "Its rate", start="free", nominal=40.0)
m.derivative(position, velocity)
m.derivative(velocity, gain * force - damping * velocity - stiffness * position)
m.output("displacement", "V", position, "Measured voltage for the displacement")

PLANT = Plant(
    m.model(),
    inputs=[Input("force", band_limited=True, zero=0.01)],
    outputs=[Output("displacement", zero=0.01)],
    places=[Balance("velocity", displacement="position"), Path("force"), Path("displacement")],
)
