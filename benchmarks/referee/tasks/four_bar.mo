model Mechanism "angles of coupler and rocker in space"
  Real turn, turn_dot, turn_ddot, chi(start = 0.9), swing(start = 1.8), chi_dot, swing_dot, chi_ddot, swing_ddot;
  Real force, work(start = 0, fixed = true), up, along;
equation
  0.5*cos(turn) + 1.5*cos(chi) = 1.5 + 1.2*cos(swing);
  0.5*sin(turn) + 1.5*sin(chi) = 1.2*sin(swing);
  0.5*sin(turn)*turn_dot + 1.5*sin(chi)*chi_dot = 1.2*sin(swing)*swing_dot;
  0.5*cos(turn)*turn_dot + 1.5*cos(chi)*chi_dot = 1.2*cos(swing)*swing_dot;
  0.5*(sin(turn)*turn_ddot + cos(turn)*turn_dot^2) + 1.5*(sin(chi)*chi_ddot + cos(chi)*chi_dot^2)
    = 1.2*(sin(swing)*swing_ddot + cos(swing)*swing_dot^2);
  0.5*(cos(turn)*turn_ddot - sin(turn)*turn_dot^2) + 1.5*(cos(chi)*chi_ddot - sin(chi)*chi_dot^2)
    = 1.2*(cos(swing)*swing_ddot - sin(swing)*swing_dot^2);
  // Rate of the energy; acceleration of the coupler's middle.
  along = -0.5*(sin(turn)*turn_ddot + cos(turn)*turn_dot^2) - 0.75*(sin(chi)*chi_ddot + cos(chi)*chi_dot^2);
  up = 0.5*(cos(turn)*turn_ddot - sin(turn)*turn_dot^2) + 0.75*(cos(chi)*chi_ddot - sin(chi)*chi_dot^2) + 9.81;
  force*turn_dot = 0.0825*turn_dot*turn_ddot + 0.4*chi_dot*chi_ddot + 0.74*swing_dot*swing_ddot
    + 2*(up*(0.5*cos(turn)*turn_dot + 0.75*cos(chi)*chi_dot) - along*(0.5*sin(turn)*turn_dot + 0.75*sin(chi)*chi_dot))
    + 9.81*(0.25*cos(turn)*turn_dot + 0.9*cos(swing)*swing_dot);
  der(work) = force*turn_dot;
end Mechanism;

model Prescribed
  extends Mechanism;
equation
  turn = 1 + 3*time + 0.3*sin(2*time);
  turn_dot = der(turn);
  turn_ddot = der(turn_dot);
end Prescribed;
