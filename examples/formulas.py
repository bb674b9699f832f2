"""Formulas of an arm
==================

The script prints the mass matrix of an arm with two parallel joint axes as a formula. It compares the formulas with numbers that the Rust
core computes, and prints the regressor of a robot with a prismatic and a revolute joint in LaTeX.

Run: ``python examples/formulas.py``
"""

import numpy as np

import armlet as al

phi = [2.0, 0.4, 0.0, 0.0, 0.01, 0.0, 0.12, 0.0, 0.0, 0.12]  # mass (kg), m c (kg m), inertia about the joint (kg m^2)
joints = [
    {"type": "R", "axis": [0, 0, 1], "phi": [0, 0, 0, 0, 0, 0, 0, 0, 0, 0.05]},
    {"type": "R", "axis": [0, 0, 1], "rpy": [np.pi / 2, 0, 0], "phi": phi},
    {"type": "R", "axis": [0, 0, 1], "xyz": [0.4, 0, 0], "phi": phi},
]
arm = al.Arm.from_chain(joints)
formulas = arm.symbolic(lengths=True)
for i, row in enumerate(formulas.M.tolist()):
    for j, entry in enumerate(row[: i + 1]):
        print(f"M[{i}, {j}] = {entry}")
print("g =", formulas.g.tolist())

q, v = np.random.default_rng(1).uniform(-3.0, 3.0, (2, 1000, 3))
for name, wanted in (("M", arm.mass_matrix(q)), ("C", arm.coriolis_matrix(q, v)), ("g", arm.gravity(q))):
    found = formulas.function(name)(q, v) if name == "C" else formulas.function(name)(q)
    print(f"{name}: at 1,000 states formula and core differ by {np.abs(found - wanted).max():.0e}")

print(al.planar_pr(2.0, 0.5, 0.5).symbolic().latex("Y"))
