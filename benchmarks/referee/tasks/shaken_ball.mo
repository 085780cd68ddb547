model Mechanism
  Real height(start = 0.5, fixed = true), rate(start = 0, fixed = true);
  Real table, table_dot, table_ddot;
  Real force(start = 0, fixed = true) "sum of impulses", work(start = 0, fixed = true);
equation
  der(height) = rate;
  der(rate) = -9.81;
  der(force) = 0;
  der(work) = 0;
  when height <= table then
    reinit(rate, 1.8*table_dot - 0.8*pre(rate));
    reinit(force, force + 1.8*(table_dot - pre(rate)));
    reinit(work, work + 1.8*(table_dot - pre(rate))*table_dot);
  end when;
end Mechanism;

model Prescribed
  extends Mechanism;
equation
  table = 0.05*sin(6*time);
  table_dot = der(table);
  table_ddot = der(table_dot);
end Prescribed;
