"""A co-simulation slave in plain Python, in several modules: nothing but Python's standard library and pythonfmu.

`python_fmu.py` joins them into the one file of an FMU, with an emitted model in the place of `stand_in.py`. As they
stand they simulate that stand-in, so that they can be imported, run and checked by themselves::

    from tubular_dea.export.slave.instance import PythonSlave

    slave = PythonSlave(instance_name="test")
    slave.setup_experiment(0.0, None, None)
    slave.enter_initialization_mode()
    slave.set_real([2], [0.4])
    slave.exit_initialization_mode()
    slave.do_step(0.0, 0.01)
    slave.get_real([3])

Nothing here needs more than Python 3.9, because the host brings the Python.
"""
