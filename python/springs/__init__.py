"""Mass-spring simulation with numpy arrays, in SI units.

>>> import springs as sp
>>> s = sp.Scene(gravity=(0, 0, -9.81))
>>> s.nodes([(0, 0, 0), (1, 0, 0)], mass=0.1)
array([0, 1])
>>> s.springs([(0, 1)], stiffness=100)
array([0])
>>> s.fix(0)
>>> r = s.run(1.0, tolerance=1e-4, frames=10)
>>> r.x.shape
(11, 2, 3)
"""

from ._errors import Error, Interrupted, SceneError, StepError, SystemError
from ._springs import Check, Equilibrium, Law, Result, Scene, Simulation, Study, __version__, load
from ._sweep import SweepResult, sweep

__all__ = [
    "Check",
    "Equilibrium",
    "Error",
    "Interrupted",
    "Law",
    "Result",
    "Scene",
    "SceneError",
    "Simulation",
    "StepError",
    "Study",
    "SweepResult",
    "SystemError",
    "load",
    "sweep",
]
