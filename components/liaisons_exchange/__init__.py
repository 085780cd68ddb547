"""Systems and components in the formats of other tools: SSP, Modelica, live pages."""
