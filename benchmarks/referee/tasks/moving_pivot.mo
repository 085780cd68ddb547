model Mechanism
  Real theta(start = 0.3, fixed = true), theta_dot(start = 0.0, fixed = true), theta_ddot;
  Real pivot_x, pivot_x_dot, pivot_x_ddot, force;
  Real work(start = 0, fixed = true);
equation
  der(theta) = theta_dot;
  der(theta_dot) = theta_ddot;
  0 = pivot_x_ddot*cos(theta) + theta_ddot + 9.81*sin(theta);
  force = pivot_x_ddot + theta_ddot*cos(theta) - theta_dot^2*sin(theta);
  der(work) = force*pivot_x_dot;
end Mechanism;

model Prescribed
  extends Mechanism;
equation
  pivot_x = 0.1*sin(3*time);
  pivot_x_dot = der(pivot_x);
  pivot_x_ddot = der(pivot_x_dot);
end Prescribed;
