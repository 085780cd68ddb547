model Mechanism
  Real xi(start = 1.0, fixed = true), xi_dot(start = 1.0, fixed = true), xi_ddot;
  Real beta, beta_dot, beta_ddot, force;
  Real work(start = 0, fixed = true);
equation
  der(xi) = xi_dot;
  der(xi_dot) = xi_ddot;
  0 = 0.5*beta_ddot*cos(xi) + 1.0*beta_ddot + 0.5*beta_dot^2*sin(xi) + 1.0*xi_ddot;
  force = 1.0*beta_ddot*cos(xi) + 1.35*beta_ddot - 1.0*beta_dot*xi_dot*sin(xi) + 0.5*xi_ddot*cos(xi) +
    1.0*xi_ddot - 0.5*xi_dot^2*sin(xi);
  der(work) = force*beta_dot;
end Mechanism;

model Prescribed
  extends Mechanism;
equation
  beta = 2*time + time^2/4;
  beta_dot = der(beta);
  beta_ddot = der(beta_dot);
end Prescribed;
