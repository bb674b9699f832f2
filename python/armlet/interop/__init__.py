"""Interfaces to other libraries, imported on first use: arms from Pinocchio and MuJoCo, methods for scipy, systems of python-control."""

from .models import from_mujoco, from_pinocchio
from .python_control import to_control
from .scipy_solver import scipy_method
from .verification import Verification, verify

__all__ = ["Verification", "from_mujoco", "from_pinocchio", "scipy_method", "to_control", "verify"]
