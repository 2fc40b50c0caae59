"""One run, from a file of YAML to a recording; read the modules in this order.

1. `kinds`: what a scenario must know of each kind of controller, as data.
2. `scenario`: a run as data, read from YAML and checked: robot, motion, plant, drive, controller.
3. `plant`, `tuning`: what the plant is along the motion (inertia, springs, friction), and the gains
   and the torque feedforward of the controller.
4. `design`: a scenario with everything computed that its loop needs. `make_design(scenario)`
   loads the robot, plans the motion, and checks that the loop can be simulated.
5. `controllers`: each controller as a Drake system, made of a design, from measured state and
   reference to commanded torque; how to register one of your own.
6. `device_diagram`: drives, elastic joints, plant and loads, and the equilibrium that a run starts
   in.
7. `loop`: the whole diagram, block by block in the order of the signals:

       reference source -> zero-order hold -> controller -> saturation -> drives -> plant
                                                  ^-------- encoders <---------------'

8. `simulate`: a simulator for it, and the `Recording` that a run leaves.

The blocks themselves are in `sdt_drake.systems`, a class and a file for each; its docstring says
what travels on each wire, with units and side.
"""
