"""Coupling by curves: FMUs are told how inputs move; in a cycle a step is repeated until its end fits.

Explicit coupling (:mod:`liaisons.cosim.structure.schedule`) hands
over what is known before a step.  Here the values at its end
are unknowns x that solve x = F(x), where F takes every FMU back to the begin of the step, gives it polynomials
through both ends for its inputs, steps it, and reads its outputs.

* ``"waveform"``: x := F(x), one FMU after the other (Picard iteration; Lelarasmee, Ruehli and
  Sangiovanni-Vincentelli 1982).  It contracts where forces react little on accelerations: for two masses in one line,
  Θ/m < 1.
* ``"implicit"``: Newton's method.  ∂F/∂x comes from the directional derivatives of the FMUs: at a communication
  point forces are affine in accelerations, λ = λ_0 + Θ σ'' with the effective mass Θ (M eq. 50), and so this loop,
  which makes explicit coupling unstable, is solved exactly whatever the ratio of the masses.  How an input moves a port
  through its acceleration is in ∂F/∂x, too; what else goes through the states of the FMUs is of order H, and the
  secants of the iteration bring it in (Anderson 1965).

Both end at the same solution.  Between the ends an input follows the polynomial that its data determine:

=========================================  =======================  ====================================
source                                     polynomial               error of the motion
=========================================  =======================  ====================================
port (q, q_dot, q_ddot)                    quintic Hermite          H⁶
output whose derivative the FMU gives      cubic Hermite            H⁴ (two-derivative Lobatto quadrature)
other output, of a cycle                   linear                   H²
other output                               cubic through points     H⁴
input of an FMU that holds its inputs      mean of both ends        H²
=========================================  =======================  ====================================

Outside of cycles the source has been stepped, so that both ends are known; where nobody gives derivatives, the points
before t, at the begin those in the step, take their place; of a function of time always these.  What is discrete goes
on as it was at t until the end of the step.  Where sources announce that something jumps, the past is forgotten
(``liaisons.cosim.running.breaks``).

The polynomials of an FMU of ours reach it as derivatives of its inputs (``fmi2SetRealInputDerivatives``).  FMI 3.0 has
none; there it asks for its inputs at the fifths of a step, in intermediate update mode, and follows the quintic through
them.  One of the Python back end can do neither: it interpolates between the ends itself, quintic and linear, and its
outputs have no derivatives; a cycle with it is of second order.

``coupling.c`` makes the steps.  What stands here makes them itself where there is no C compiler, operation by operation
alike, to the same bits: whoever changes one changes the other, and ``tests/cosim/test_loop.py`` compares them.
"""

from __future__ import annotations
