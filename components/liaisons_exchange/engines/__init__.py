"""Prescribed joints in other multibody engines, by the operator's exact force."""

from liaisons_exchange.engines.motions import Motion
from liaisons_exchange.engines.mujoco_operator import MujocoOperator
from liaisons_exchange.engines.pinocchio_operator import PinocchioOperator

__all__ = ["Motion", "MujocoOperator", "PinocchioOperator"]
