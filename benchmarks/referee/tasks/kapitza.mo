model Mechanism
  Real theta(start = 3.041592653589793, fixed = true), theta_dot(start = 0.0, fixed = true), theta_ddot;
  Real pivot_z, pivot_z_dot, pivot_z_ddot, force;
  Real work(start = 0, fixed = true);
equation
  der(theta) = theta_dot;
  der(theta_dot) = theta_ddot;
  0 = pivot_z_ddot*sin(theta) + theta_ddot + 9.81*sin(theta);
  force = pivot_z_ddot + theta_ddot*sin(theta) + theta_dot^2*cos(theta) + 9.81;
  der(work) = force*pivot_z_dot;
end Mechanism;

model Prescribed
  extends Mechanism;
equation
  pivot_z = 0.1*sin(50*time);
  pivot_z_dot = der(pivot_z);
  pivot_z_ddot = der(pivot_z_dot);
end Prescribed;
