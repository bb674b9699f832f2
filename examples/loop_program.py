"""The program of a loop
=====================

armlet compiles a control loop to a *program*, which is straight-line machine code. The example is a step of a pendulum under PD control
with gravity compensation. The script prints its simplified program, and the number of lines in each form: recorded, simplified, lowered to
the instruction set, and machine code.

Run: ``python examples/loop_program.py [figure.png]``
"""

import sys

import armlet as al

arm = al.pendulum(0.3, 2.0)  # I = 0.3 kg m^2, G = 2 N m
law = al.PDGravity(arm, target=[1.0], kp=40.0, kd=7.0)
program = al.loop_program(al.RigidArm(arm), law, method="euler")
print(program)

# For larger loops, the table has the number of operations in the recording, and the number after simplification.
print("\n   arm            recorded  simplified  instructions  longest chain")
six = al.load_urdf(al.example_urdf("six_axis"))
arms = {"pendulum": arm, "planar 2R": al.planar_arm([0.5, 0.4]), "planar 4R": al.planar_arm([0.4] * 4), "six axes": six}
for name, other in arms.items():
    law = al.PDGravity(other, target=[0.3] * other.n, kp=40.0, kd=7.0)
    rates = al.loop_program(al.RigidArm(other), law, method="dopri5")  # the program of one evaluation of the right-hand side
    sizes = [len(rates.at(stage)) for stage in ("recorded", "simplified", "lowered")]
    print(f"   {name:12} {sizes[0]:10} {sizes[1]:11} {sizes[2]:13} {rates.at('lowered').critical_path:14}")

if len(sys.argv) > 1:
    program.plot().figure.savefig(sys.argv[1], dpi=150)
