"""Whether a step that is rolled back and repeated gives the same numbers."""

from __future__ import annotations

from ctypes import c_double

import numpy as np

from liaisons.base.folders import temporary_folder
from liaisons.cosim.compiled.calls import Call
from liaisons.cosim.description.fmu import Fmu
from liaisons.cosim.instances import extract_fmus, make_instance
from liaisons.cosim.messages import WARNING


def roll_back_difference(fmu: Fmu, step_size: float, tolerance: float) -> float | None:
    """Largest difference between two steps and their repetition after a roll-back; None if it has no roll-back."""
    outputs = [fmu.variables[name] for name in fmu.reals("output")]
    if not (fmu.can_get_and_set_state and outputs):
        return None
    seen = (c_double * len(outputs))()
    time, size = c_double(0.0), c_double(step_size)
    results = []
    with (
        temporary_folder() as folder,
        make_instance(fmu.path.stem, fmu, extract_fmus([fmu], folder)[fmu.path]) as instance,
    ):
        instance.initialize({}, tolerance, 0.0, 3 * step_size)
        instance.exit_initialization()
        save, restore = instance.save_and_restore_calls()
        step, get = instance.stepper(time, size), instance.getter(outputs, seen)

        def call_or_raise(*calls: Call) -> None:
            """Call functions of the FMU, and raise an error if one fails."""
            for call in calls:
                status = call()
                if status and status > WARNING:
                    raise instance.failure(call.action, status, " in the roll-back")

        call_or_raise(step, save)  # the history of solver and inputs has to come back, too
        for _ in range(2):
            call_or_raise(restore)
            for number in (1, 2):
                time.value = number * step_size
                call_or_raise(step)
            call_or_raise(get)
            results.append(np.array(seen))
    return float(np.max(np.abs(results[0] - results[1])))
