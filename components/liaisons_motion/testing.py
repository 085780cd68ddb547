"""Verdicts on a component as tests of pytest."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from liaisons import Verdict
from liaisons.library import Target
from liaisons_motion.examination import check_component

__all__ = ["component_test"]


def component_test(component: Target) -> Callable[..., None]:
    """Return a pytest test with a case for each verdict of :func:`liaisons.check_component`.

    One line of a test file is enough, ``test_pendulum = component_test(Pendulum)``.  The message of a case that fails
    names the changes of the source with which equations and closed form agree.

    :raises LiaisonsError: if there is no such component.
    """
    verdicts = check_component(component, seconds=1e-3).verdicts  # causes are sought where a case fails

    @pytest.mark.parametrize("verdict", verdicts, ids=[one.claim.partition(":")[0] for one in verdicts])
    def test_verdict(verdict: Verdict) -> None:
        causes = () if verdict.passed else check_component(component).causes
        assert verdict.passed, "\n".join([str(verdict), verdict.reason, *map(str, causes)])

    return test_verdict
