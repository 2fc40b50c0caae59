"""One run, from a file of YAML to a recording; read the modules in this order.

1. `kinds`: what a scenario must know of each kind of controller, as data.
2. `scenario`: a run as data, read from YAML and checked: robot, motion, plant, drive, controller.
3. `plant`, `tuning`, `reference`: what the plant is along the motion (torques, springs), gains and
   torque feedforward of the controller, and the reference that the loop holds, on its clock.
4. `design`: scenario, robot, planned and learned motion, and all that follows from them on first
   use. `make_design(scenario)` loads the robot, plans the motion, and checks that the loop can be
   simulated.
5. `controllers`: each controller as a Drake system, made of a design, from measured state and
   reference to commanded torque; how to register one of your own.
6. `device_diagram`: drives, elastic joints, plant and loads, and the equilibrium that a run starts
   in.
7. `loop`: the whole diagram, block by block in the order of the signals:

       reference source -> zero-order hold -> controller -> saturation -> drives -> plant
                                                  ^-------- encoders <---------------'

8. `simulate`: a simulator for it, and the `Recording` that a run leaves; `motor_torque`: what the
   motors gave within each period, from the meter in the loop.

The blocks themselves are in `sdt_drake.systems`, a class and a file for each; its docstring says
what travels on each wire, with units and side.
"""
