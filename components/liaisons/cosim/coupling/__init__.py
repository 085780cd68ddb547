"""Implicit and waveform coupling: inputs follow polynomials within a step, and cycles repeat it until it converges.

Explicit coupling (:mod:`liaisons.cosim.structure.schedule`) sets inputs to outputs from before a step.  Here the
outputs at its end are unknowns x that solve x = F(x), where F restores the states of all FMUs at the start of the
step, gives them polynomials through both ends for their inputs, steps them, and reads their outputs.

* ``"waveform"``: x := F(x), one FMU after the other (Picard iteration; Lelarasmee, Ruehli and Sangiovanni-Vincentelli
  1982).  It converges if the forces depend only weakly on the accelerations; for two masses in line this means Θ/m < 1.
* ``"implicit"``: Newton's method.  ∂F/∂x comes from the directional derivatives of the FMUs: at a communication point
  forces are affine in accelerations, λ = λ_0 + Θ σ'' with the effective mass Θ (M eq. 50), so this loop, which makes
  explicit coupling unstable, is solved exactly for any ratio of the masses.  ∂F/∂x also contains how an input moves a
  port by way of the port's acceleration.  All other effects through the states of the FMUs are of order H; they are
  added by the secants of the iteration (Anderson 1965).

Both methods converge to the same solution.  Between the ends of a step an input follows the polynomial that its data
determine:

=========================================  =======================  ====================================
source                                     polynomial               error of the motion
=========================================  =======================  ====================================
port (q, q_dot, q_ddot)                    quintic Hermite          H⁶
output whose derivative the FMU gives      cubic Hermite            H⁴ (two-derivative Lobatto quadrature)
other output, of a cycle                   linear                   H²
other output                               cubic through points     H⁴
input of an FMU that holds its inputs      mean of both ends        H²
=========================================  =======================  ====================================

Outside of cycles the source has already been stepped, so both ends are known.  An output without derivatives is
interpolated through points before t.  At the start, and for functions of time always, points within the step are used
instead.  Discrete outputs keep their value at t until the end of the step.  At announced breaks, points before the
break are no longer used (``liaisons.cosim.running.breaks``).

FMI 2.0 FMUs of ours take the polynomials as derivatives of their inputs (``fmi2SetRealInputDerivatives``).  FMI 3.0 has
none; there they take their inputs at the fifths of a step, in intermediate update mode, and follow the quintic through
them.  FMUs of the Python back end can do neither.  They interpolate between the ends themselves, with a quintic (ports)
or linearly (other inputs).  Their outputs have no derivatives, so a cycle that contains such an FMU is of second order.

``coupling.c`` makes the steps and solves the equations; Python prepares them, so there must be a C compiler.
"""

from __future__ import annotations
