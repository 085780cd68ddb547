model Mechanism
  Real theta(start = 0.5, fixed = true), theta_dot(start = 0.0, fixed = true), theta_ddot;
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
  length = 1 - (if time < 0.4 then 0 else 2*(time - 0.4)) + (if time < 0.5 then 0 else 2*(time - 0.5)) + (if
    time < 1.0 then 0 else 2*(time - 1.0)) - (if time < 1.1 then 0 else 2*(time - 1.1)) - (if time < 1.6 then
    0 else 2*(time - 1.6)) + (if time < 1.7 then 0 else 2*(time - 1.7)) + (if time < 2.2 then 0 else 2*(time -
    2.2)) - (if time < 2.3 then 0 else 2*(time - 2.3));
  length_dot = der(length);
  length_ddot = der(length_dot);
end Prescribed;
