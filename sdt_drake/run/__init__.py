"""One run, from a file of YAML to a recording; read the modules in this order.

1. `kinds`: options, needs and plants of each kind of controller, as data.
2. `scenario`: a run as data, read from YAML and checked: robot, motion, plant, drive, controller.
3. `plant`, `tuning`, `reference`: torques and springs of the plant along the motion; gains and
   torque feedforward of the controller; the reference that the loop holds, on its clock.
4. `design`: scenario, robot, planned and learned motion, and everything computed from them, each
   part on first use. `make_design(scenario)` loads the robot, plans the motion, and checks that
   the loop can be simulated.
5. `controllers`: each controller as a Drake system. It is made from a design and computes the
   commanded torque from measured state and reference. `register_controller` adds your own.
6. `device_diagram`: drives, elastic joints, plant and loads, and the equilibrium at which a run
   starts.
7. `loop`: the whole diagram, block by block in the order of the signals:

       reference source -> zero-order hold -> controller -> saturation -> drives -> plant
                                                  ^-------- encoders <---------------'

8. `simulate`: runs the loop and returns a `Recording`; `motor_torque`: torque of the motors within
   each period, from the meter in the loop.

The blocks themselves are in `sdt_drake.systems`, a class and a file for each. Its docstring lists
the signals between them, with units and side.
"""
