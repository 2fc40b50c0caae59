"""One run, from a file of YAML to a recording; read the modules in this order.

1. `controllers`: a file for each controller, with its options as data, which make its diagram from
   a design. It computes the commanded torque from measured state and reference.
   `register_controller` adds your own.
2. `scenario`: a run as data, read from YAML and checked: robot, motion, plant, drive, controller.
3. `plant`, `tuning`, `reference`: torques and springs of the plant along the motion; gains and
   torque feedforward of the controller; the reference that the loop holds, on its clock.
4. `design`: scenario, robot, planned and learned motion, and everything computed from them, each
   part on first use. `make_design(scenario)` loads the robot, plans the motion, and checks that
   the loop can be simulated.
5. `device`: drives, elastic joints, plant and loads, and the equilibrium at which a run
   starts.
6. `loop`: the whole diagram, block by block in the order of the signals:

       reference source -> zero-order hold -> controller -> saturation -> drives -> plant
                                                  ^-------- encoders <---------------'

7. `simulate`: runs the loop and returns a `recording`; `motor_torque`: torque of the motors within
   each period, from the meter in the loop.

The blocks themselves are in `sdt_drake.systems`, a function and a file for each. Its docstring
lists the signals between them, with units and side.
"""

from sdt_drake.run import controllers as controllers  # so that scenarios know the shipped kinds
