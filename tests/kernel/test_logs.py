"""Warnings of a run are collected, each once, for all who want them."""

from __future__ import annotations

import logging

import pytest

from liaisons.base.logs import collected_warnings, ignored_warnings, logger

pytestmark = pytest.mark.symbolic


def test_warnings_are_collected_by_all_who_want_them(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO, logger.name)
    with collected_warnings() as outer:
        logger.warning("before %d", 1)
        with collected_warnings() as inner:
            logger.warning("on two\n  lines")
            logger.info("not a warning")
            logger.error("an error is raised, too")
        logger.warning("before %d", 1)
    logger.warning("after")
    assert outer.texts == ("before 1", "on two lines")
    assert inner.texts == ("on two lines",)


def test_warnings_are_collected_whatever_is_logged(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.ERROR, logger.name)
    with collected_warnings() as found:
        logger.warning("%d lost", 2)
        with ignored_warnings():
            logger.warning("on purpose")
    assert found.texts == ("2 lost",)
    assert caplog.records == []
    caplog.set_level(logging.WARNING, logger.name)
    logger.warning("here")
    assert caplog.records[0].filename == "test_logs.py"


def test_many_warnings_are_counted() -> None:
    with collected_warnings() as found:
        for number in range(103):
            logger.warning("number %d", number)
            logger.warning("number 0")
    assert len(found.texts) == 101
    assert found.texts[-1] == "and 3 more"


def test_a_collection_is_spared_what_another_gets_instead() -> None:
    with collected_warnings() as first:
        with collected_warnings(instead_of=first) as second:
            logger.warning("%s", "between")
        logger.warning("after")
    assert (first.texts, second.texts) == (("after",), ("between",))
