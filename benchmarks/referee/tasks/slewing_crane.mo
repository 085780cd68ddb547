model Mechanism
  Real rope_x(start = 0.05, fixed = true), rope_x_dot(start = 0.0, fixed = true), rope_x_ddot;
  Real rope_y(start = -0.03, fixed = true), rope_y_dot(start = 0.0, fixed = true), rope_y_ddot;
  Real slew, slew_dot, slew_ddot, force;
  Real travel, travel_dot, travel_ddot, force_2;
  Real work(start = 0, fixed = true);
  Real c_0, c_1, c_2, c_3, c_4, c_5, c_6, c_7, c_8, c_9, c_10, c_11, c_12, c_13, c_14, c_15, c_16, c_17, c_18,
    c_19, c_20, c_21, c_22, c_23, c_24, c_25, c_26, c_27, c_28, c_29, c_30, c_31, c_32, c_33, c_34, c_35,
    c_36, c_37, c_38, c_39, c_40, c_41, c_42, c_43, c_44, c_45, c_46, c_47, c_48, c_49, c_50, c_51, c_52,
    c_53, c_54, c_55, c_56, c_57, c_58, c_59, c_60, c_61, c_62, c_63, c_64, c_65, c_66, c_67, c_68, c_69,
    c_70, c_71, c_72, c_73, c_74, c_75, c_76, c_77, c_78, c_79, c_80, c_81, c_82, c_83, c_84, c_85, c_86,
    c_87, c_88, c_89, c_90, c_91, c_92, c_93, c_94, c_95, c_96, c_97, c_98, c_99, c_100;
equation
  der(rope_x) = rope_x_dot;
  der(rope_x_dot) = rope_x_ddot;
  der(rope_y) = rope_y_dot;
  der(rope_y_dot) = rope_y_ddot;
  c_0 = sin(rope_x);
  c_1 = cos(rope_y);
  c_2 = c_0*c_1;
  c_3 = cos(rope_x);
  c_4 = c_1*slew_dot;
  c_5 = c_0*c_4;
  c_6 = c_1*rope_y_dot;
  c_7 = 20.0*c_6 - travel_dot;
  c_8 = -20.0*c_5 - c_7;
  c_9 = 20000.0*c_8;
  c_10 = c_1*rope_x_dot;
  c_11 = c_10*c_3;
  c_12 = c_0*c_10;
  c_13 = sin(rope_y);
  c_14 = 20.0*c_13;
  c_15 = c_14*rope_y_dot;
  c_16 = 20.0*c_12 + c_15*c_3;
  c_17 = 20000.0*c_16;
  c_18 = c_13*rope_y_dot;
  c_19 = c_0*c_18;
  c_20 = -c_14 + travel;
  c_21 = -c_0*c_15 + 20.0*c_11 + c_20*slew_dot;
  c_22 = 20000.0*c_21;
  c_23 = c_18*c_3;
  c_24 = 40.0*c_19;
  c_25 = 500.0*c_16;
  c_26 = c_13*slew_dot;
  c_27 = c_0*c_26;
  c_28 = c_0^2;
  c_29 = c_3^2;
  c_30 = c_10*c_28 + c_10*c_29 - c_26*c_3;
  c_31 = 500.0*c_30;
  c_32 = 40.0*c_23;
  c_33 = 500.0*c_21;
  c_34 = c_1*rope_x_ddot;
  c_35 = c_0*c_34;
  c_36 = c_14*rope_y_ddot;
  c_37 = rope_x_dot^2;
  c_38 = c_1*c_3;
  c_39 = c_37*c_38;
  c_40 = rope_y_dot^2;
  c_41 = c_38*c_40;
  c_42 = -c_24*rope_x_dot + c_3*c_36 + 20.0*c_35 + 20.0*c_39 + 20.0*c_41;
  c_43 = 2*c_18;
  c_44 = 250.0*c_30;
  c_45 = 2*c_6;
  c_46 = c_13*rope_x_dot;
  c_47 = c_0*c_46;
  c_48 = c_3*c_6;
  c_49 = c_47 - c_48;
  c_50 = c_3*c_46;
  c_51 = c_0*c_6;
  c_52 = c_50 + c_51;
  c_53 = c_4 + c_52;
  c_54 = c_0*c_49 + c_3*c_53;
  c_55 = 150.0*c_54;
  c_56 = c_2*c_37;
  c_57 = c_2*c_40;
  c_58 = -c_0*c_36 + 20.0*c_1*c_3*rope_x_ddot + c_20*slew_ddot - c_32*rope_x_dot - 20.0*c_56 - 20.0*c_57 -
    c_7*slew_dot;
  c_59 = 20000.0*c_58;
  c_60 = 2*c_1;
  c_61 = c_13*slew_ddot;
  c_62 = c_4*rope_y_dot;
  c_63 = c_18*rope_x_dot;
  c_64 = c_0*c_13*rope_x_dot*slew_dot + c_1*c_28*rope_x_ddot + c_1*c_29*rope_x_ddot - c_28*c_63 - c_29*c_63 -
    c_3*c_61 - c_3*c_62;
  c_65 = 2*c_0;
  c_66 = 2*c_3;
  c_67 = c_3*c_49;
  c_68 = c_0*c_53;
  c_69 = 2*c_13;
  c_70 = c_13*rope_x_ddot;
  c_71 = c_1*rope_y_ddot;
  c_72 = c_13*c_37;
  c_73 = c_13*c_40;
  c_74 = 2*rope_x_dot;
  c_75 = c_1*slew_ddot;
  c_76 = c_26*rope_y_dot;
  c_77 = c_0*(c_0*c_70 - c_3*c_71 + c_3*c_72 + c_3*c_73 + c_51*c_74) + c_3*(c_0*c_71 - c_0*c_72 - c_0*c_73 +
    c_3*c_70 + c_48*c_74 + c_75 - c_76) + c_67*rope_x_dot - c_68*rope_x_dot;
  c_78 = 2*c_1^2;
  c_79 = c_3*c_78;
  c_80 = c_12 + c_23;
  c_81 = c_0*c_69;
  c_82 = c_3*c_69;
  c_83 = -c_80;
  c_84 = -c_11 + c_19 + c_26;
  c_85 = c_5 + c_6;
  c_86 = c_13*c_3;
  c_87 = c_0*c_13;
  c_88 = c_1*c_85 - c_83*c_86 + c_84*c_87;
  c_89 = 250.0*c_88;
  c_90 = 40.0*c_13;
  c_91 = c_0*c_75;
  c_92 = c_3*rope_x_dot;
  c_93 = c_4*c_92;
  c_94 = 400000.0*c_0*c_13*rope_y_dot*slew_dot + 400000.0*c_13*c_40 - 400000.0*c_71 - 400000.0*c_91 -
    400000.0*c_93 + 20000.0*travel_ddot;
  c_95 = 2*c_46;
  c_96 = 4*c_13*c_6;
  c_97 = c_13^2;
  c_98 = 2*c_97;
  c_99 = c_1*(-c_0*c_76 + c_71 - c_73 + c_91 + c_93) - c_18*c_85 + c_47*c_83 - c_48*c_83 + c_50*c_84 +
    c_51*c_84 - c_86*(2*c_0*c_13*rope_x_dot*rope_y_dot - c_35 - c_39 - c_41 - c_86*rope_y_ddot) +
    c_87*(-c_3*c_34 + c_56 + c_57 + c_61 + c_62 + c_63*c_66 + c_87*rope_y_ddot);
  c_100 = 300.0*c_54;
  0 = c_11*c_17 - c_12*c_22 - c_17*c_19 + 20000.0*c_2*c_42 + 196200.0*c_2 - c_22*c_23 - c_25*(40.0*c_11 -
    c_24) - c_27*c_31 + c_3*c_4*c_9 - c_33*(-40.0*c_12 - c_32) + c_38*c_59 + c_44*(-c_28*c_43 - c_29*c_43) +
    c_55*(c_28*c_45 + c_29*c_45) - c_55*(-c_49*c_66 + c_52*c_65 + 2*c_67 - 2*c_68) + 250.0*c_64*(c_28*c_60 +
    c_29*c_60) + 150.0*c_77*(c_28*c_69 + c_29*c_69) - c_89*(c_79*slew_dot + c_80*c_81 + c_81*c_83 + c_82*c_84
    - c_82*(-c_11 + c_19));
  0 = 20000.0*c_1*c_16*c_3*rope_y_dot - c_1*c_94 + 20000.0*c_13*c_3*c_42 + 196200.0*c_13*c_3 +
    20000.0*c_13*c_8*rope_y_dot - c_17*c_47 - c_22*c_50 - c_22*c_51 - c_25*(-c_0*c_90*rope_x_dot +
    40.0*c_1*c_3*rope_y_dot) - c_33*(-40.0*c_4 - 40.0*c_51 - c_90*c_92) - c_44*(-c_28*c_95 - c_29*c_95 -
    c_4*c_66) - c_55*(c_65*c_80 - c_66*c_84) - c_59*c_87 - 500.0*c_8*(40.0*c_18 + 40.0*c_27) +
    250.0*c_88*(c_28*c_96 + c_29*c_96 - c_96) - c_89*(c_0*c_60*c_84 - c_3*c_60*c_83 + c_60*(-c_18 - c_27) -
    c_67*c_69 + c_68*c_69 - c_69*c_85) + 250.0*c_99*(c_28*c_98 + c_29*c_98 + c_78);
  force = -c_100*c_12 - c_100*c_23 - c_11*c_9 + c_19*c_9 - c_2*c_94 + c_31*c_47 - c_31*c_48 + c_33*(-40.0*c_6
    + 2*travel_dot) + 300.0*c_38*c_77 + 500.0*c_58*(-c_90 + 2*travel) - 500.0*c_64*c_86 +
    c_89*(c_66*c_97*rope_x_dot + c_79*rope_x_dot) + 250.0*c_99*(c_0*c_78 + c_65*c_97) +
    400.0*slew_ddot*travel^2 + 100000.0*slew_ddot + 800.0*slew_dot*travel*travel_dot;
  force_2 = 20000.0*c_0*c_13*rope_y_dot*slew_dot + 20000.0*c_13*c_40 - 1000.0*c_21*slew_dot - 20000.0*c_71 -
    20000.0*c_91 - 20000.0*c_93 - 400.0*slew_dot^2*travel + 1400.0*travel_ddot;
  der(work) = force*slew_dot + force_2*travel_dot;
end Mechanism;

model Prescribed
  extends Mechanism;
equation
  slew = 0.3 - 0.3*cos(0.8*time);
  slew_dot = der(slew);
  slew_ddot = der(slew_dot);
  travel = 8 + 1.5*sin(0.6*time);
  travel_dot = der(travel);
  travel_ddot = der(travel_dot);
end Prescribed;
