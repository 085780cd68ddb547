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

model Driven
  extends Mechanism(support(start = 0, fixed = true), support_dot(start = 0.5, fixed = true));
  parameter Real k = 1e4;
  Real support_aim, support_aim_dot;
equation
  der(support) = support_dot;
  der(support_dot) = support_ddot;
  support_aim = 0.1*sin(5*time);
  support_aim_dot = der(support_aim);
  force + support_ddot = k*(support_aim - support) + 2*sqrt(k)*(support_aim_dot - support_dot); // wall of 1 kg
end Driven;
