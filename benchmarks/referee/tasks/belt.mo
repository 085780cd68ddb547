model Mechanism
  Real x(start = 0, fixed = true), x_dot(start = 0, fixed = true);
  Real belt, belt_dot, belt_ddot, force, work(start = 0, fixed = true);
equation
  der(x) = x_dot;
  der(x_dot) = force - 10*x;
  force = 0.981*tanh((belt_dot - x_dot)/1e-4); // the steepest that its solvers take
  der(work) = force*belt_dot;
end Mechanism;

model Prescribed
  extends Mechanism;
equation
  belt = 0.5*sin(2*time);
  belt_dot = der(belt);
  belt_ddot = der(belt_dot);
end Prescribed;
