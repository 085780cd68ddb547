model Mechanism
  Real q_w(start = 1, fixed = true), q_x(start = 0, fixed = true), q_y(start = 0, fixed = true);
  Real q_z(start = 0, fixed = true), omega_x(start = 0.1, fixed = true), omega_y(start = -0.05, fixed = true);
  Real omega_z(start = 0.2, fixed = true), work(start = 0, fixed = true), h_x, h_y, h_z;
  Real wheel_1, wheel_1_dot, wheel_1_ddot, force;
  Real wheel_2, wheel_2_dot, wheel_2_ddot, force_2;
  Real wheel_3, wheel_3_dot, wheel_3_ddot, force_3;
equation
  der(q_w) = -(q_x*omega_x + q_y*omega_y + q_z*omega_z)/2;
  der(q_x) = (q_w*omega_x + q_y*omega_z - q_z*omega_y)/2;
  der(q_y) = (q_w*omega_y + q_z*omega_x - q_x*omega_z)/2;
  der(q_z) = (q_w*omega_z + q_x*omega_y - q_y*omega_x)/2;
  h_x = 10*omega_x + 0.1*wheel_1_dot;
  h_y = 12*omega_y + 0.1*wheel_2_dot;
  h_z = 8*omega_z + 0.1*wheel_3_dot;
  10*der(omega_x) + 0.1*wheel_1_ddot = h_y*omega_z - h_z*omega_y;
  12*der(omega_y) + 0.1*wheel_2_ddot = h_z*omega_x - h_x*omega_z;
  8*der(omega_z) + 0.1*wheel_3_ddot = h_x*omega_y - h_y*omega_x;
  force = 0.1*(wheel_1_ddot + der(omega_x));
  force_2 = 0.1*(wheel_2_ddot + der(omega_y));
  force_3 = 0.1*(wheel_3_ddot + der(omega_z));
  der(work) = force*wheel_1_dot + force_2*wheel_2_dot + force_3*wheel_3_dot;
end Mechanism;

model Prescribed
  extends Mechanism;
equation
  wheel_1 = 40*sin(0.7*time);
  wheel_1_dot = der(wheel_1);
  wheel_1_ddot = der(wheel_1_dot);
  wheel_2 = 20 + 20*sin(1.1*time - 1.5);
  wheel_2_dot = der(wheel_2);
  wheel_2_ddot = der(wheel_2_dot);
  wheel_3 = 5 + 30*sin(0.5*time + 0.4);
  wheel_3_dot = der(wheel_3);
  wheel_3_ddot = der(wheel_3_dot);
end Prescribed;
