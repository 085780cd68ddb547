model Mechanism
  Real theta(start = 0.3, fixed = true), theta_dot(start = 0.0, fixed = true), theta_ddot;
  Real length, length_dot, length_ddot, force;
  Real work(start = 0, fixed = true);
equation
  der(theta) = theta_dot;
  der(theta_dot) = theta_ddot;
  0 = length*(length*theta_ddot + 2*length_dot*theta_dot + 9.81*sin(theta));
  force = -length*theta_dot^2 + length_ddot - 9.81*cos(theta);
  der(work) = force*length_dot;
end Mechanism;

model Prescribed
  extends Mechanism;
equation
  length = 1 + 0.15*sin(6.2642*time);
  length_dot = der(length);
  length_ddot = der(length_dot);
end Prescribed;
