model Mechanism
  Real x(start = 0, fixed = true), x_dot(start = 0, fixed = true);
  Real support, support_dot, support_ddot, force, work(start = 0, fixed = true);
equation
  der(x) = x_dot;
  der(x_dot) = force;
  force = 25*(support - x);
  der(work) = force*support_dot;
end Mechanism;

model Prescribed
  extends Mechanism;
equation
  support = 0.1*sin(5*time);
  support_dot = der(support);
  support_ddot = der(support_dot);
end Prescribed;
