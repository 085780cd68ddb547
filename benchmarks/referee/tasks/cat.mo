model Mechanism
  Real phi(start = 0.0, fixed = true), phi_dot(start = 0.5, fixed = true), phi_ddot;
  Real psi_1, psi_1_dot, psi_1_ddot, force;
  Real psi_2, psi_2_dot, psi_2_ddot, force_2;
  Real work(start = 0, fixed = true);
  Real c_0, c_1, c_2, c_3, c_4, c_5, c_6, c_7, c_8, c_9, c_10, c_11, c_12, c_13, c_14, c_15, c_16, c_17, c_18,
    c_19, c_20, c_21, c_22, c_23, c_24, c_25, c_26, c_27, c_28, c_29, c_30, c_31, c_32, c_33, c_34, c_35,
    c_36, c_37, c_38;
equation
  der(phi) = phi_dot;
  der(phi_dot) = phi_ddot;
  c_0 = 0.02*psi_1_ddot;
  c_1 = 0.02*psi_2_ddot;
  c_2 = sin(phi);
  c_3 = 0.4*c_2;
  c_4 = phi + psi_1;
  c_5 = sin(c_4);
  c_6 = 0.3*c_5;
  c_7 = 0.2*phi_ddot;
  c_8 = cos(phi);
  c_9 = 0.2*phi_dot^2;
  c_10 = c_2*c_7 + c_8*c_9;
  c_11 = (phi_dot + psi_1_dot)^2;
  c_12 = cos(c_4);
  c_13 = 0.15*c_12;
  c_14 = phi_ddot + psi_1_ddot;
  c_15 = 0.15*c_5;
  c_16 = c_11*c_13 + c_14*c_15;
  c_17 = -c_10 - c_16;
  c_18 = phi + psi_2;
  c_19 = sin(c_18);
  c_20 = cos(c_18);
  c_21 = (phi_dot + psi_2_dot)^2;
  c_22 = 0.15*c_21;
  c_23 = phi_ddot + psi_2_ddot;
  c_24 = 0.15*c_23;
  c_25 = c_10 + c_19*c_24 + c_20*c_22;
  c_26 = 0.4*c_8;
  c_27 = 0.3*c_20;
  c_28 = c_20*c_24;
  c_29 = -c_2*c_9 + c_7*c_8;
  c_30 = 0.15*c_19*c_21 - c_28 - c_29;
  c_31 = 0.3*c_12;
  c_32 = -c_11*c_15 + c_13*c_14;
  c_33 = c_29 + c_32;
  c_34 = -c_16 + 0.15*c_19*c_23 + 0.15*c_20*c_21;
  c_35 = c_19*c_22 - c_28 + c_32;
  c_36 = 0.02*phi_ddot;
  c_37 = 0.0375*c_34;
  c_38 = 0.0375*c_35;
  0 = c_0 + c_1 + 0.5*c_17*(-c_3 - c_6) + 0.5*c_25*(0.3*c_19 + c_3) + 0.5*c_30*(-c_26 - c_27) + 0.5*c_33*(c_26
    + c_31) - 0.125*c_34*(0.3*c_19 - c_6) - 0.125*c_35*(-c_27 + c_31) + 0.09*phi_ddot;
  force = c_0 - c_12*c_38 + c_13*c_33 - c_15*c_17 + c_36 + c_37*c_5;
  force_2 = c_1 + 0.15*c_19*c_25 - c_19*c_37 - 0.15*c_20*c_30 + c_20*c_38 + c_36;
  der(work) = force*psi_1_dot + force_2*psi_2_dot;
end Mechanism;

model Prescribed
  extends Mechanism;
equation
  psi_1 = 0.5 - 0.8*cos(4*time);
  psi_1_dot = der(psi_1);
  psi_1_ddot = der(psi_1_dot);
  psi_2 = 0.9*sin(4*time);
  psi_2_dot = der(psi_2);
  psi_2_ddot = der(psi_2_dot);
end Prescribed;
