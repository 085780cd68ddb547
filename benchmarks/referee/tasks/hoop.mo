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

model Driven
  extends Mechanism(beta(start = 0.0, fixed = true), beta_dot(start = 2.0, fixed = true));
  parameter Real k = 1e4;
  Real beta_aim, beta_aim_dot;
equation
  der(beta) = beta_dot;
  der(beta_dot) = beta_ddot;
  beta_aim = 2*time + time^2/4;
  beta_aim_dot = der(beta_aim);
  force = k*(beta_aim - beta) + 2*sqrt(k)*(beta_aim_dot - beta_dot);
end Driven;
