"""Functions that analyse the Lagrangian of a mechanism without simulation.

Each takes a :class:`Mechanism` class (or its :class:`Equations`) and returns numbers, or a :class:`Quantity`, which is
evaluated with values of its symbols by name::

    H = analysis.hamiltonian(Pendulum)
    H.evaluate(theta=0.3, p_theta=1.0, length=2.0)

A law that constraints, contacts, friction, drives or loads break is refused, with an error that names what breaks it.

========================  ===================================================================  ===================
conservation laws         cyclic_coordinates, noether                                          K 2.4
similarity and virial     similarity, virial                                                   K 2.5, 2.7
variational principles    action, stationary_path, vakonomic_equations, gauss_function         K 3.1, 4, M 3
Hamilton's mechanics      hamiltonian, hamilton_equations, observable, poisson_bracket         K 3.2, 3.3
phase space               phase_velocity, divergence, flow                                     K 3.4
vibrations                equilibrium, normal_modes                                            K 5.2
active constraints        active_hamiltonian, effective_mass, active_energy, dynamic_field     M 6, 7
multipliers               legendre_rank, multiplier_equations, reduced_multiplier_equations    M 4, 6
geometry of shapes        kinetic_connection, curvature, holonomy, curvature_integral          M 7, 8
========================  ===================================================================  ===================
"""

from liaisons_motion.analysis.active import (
    DynamicField,
    active_energy,
    active_hamiltonian,
    curvature,
    curvature_integral,
    dynamic_field,
    dynamic_holonomy,
    effective_mass,
    holonomy,
    kinetic_connection,
    legendre_rank,
    multiplier_equations,
    reduced_multiplier_equations,
)
from liaisons_motion.analysis.phase_space import (
    Flow,
    divergence,
    flow,
    hamilton_equations,
    hamiltonian,
    phase_velocity,
    poisson_bracket,
)
from liaisons_motion.analysis.principles import (
    Action,
    StationaryPath,
    action,
    gauss_function,
    stationary_path,
    vakonomic_equations,
)
from liaisons_motion.analysis.quantity import Quantity, observable
from liaisons_motion.analysis.symmetry import (
    MomentumMap,
    Similarity,
    Virial,
    cyclic_coordinates,
    momentum_map,
    noether,
    similarity,
    virial,
)
from liaisons_motion.analysis.vibrations import NormalModes, equilibrium, normal_modes

__all__ = [
    "Action",
    "DynamicField",
    "Flow",
    "MomentumMap",
    "NormalModes",
    "Quantity",
    "Similarity",
    "StationaryPath",
    "Virial",
    "action",
    "active_energy",
    "active_hamiltonian",
    "curvature",
    "curvature_integral",
    "cyclic_coordinates",
    "divergence",
    "dynamic_field",
    "dynamic_holonomy",
    "effective_mass",
    "equilibrium",
    "flow",
    "gauss_function",
    "hamilton_equations",
    "hamiltonian",
    "holonomy",
    "kinetic_connection",
    "legendre_rank",
    "momentum_map",
    "multiplier_equations",
    "noether",
    "normal_modes",
    "observable",
    "phase_velocity",
    "poisson_bracket",
    "reduced_multiplier_equations",
    "similarity",
    "stationary_path",
    "vakonomic_equations",
    "virial",
]
