"""Fixtures of all tests of studies."""

import pytest


@pytest.fixture(scope="module", autouse=True)
def without_figures():
    """Studies draw no figures, which take most of the time and have tests of their own."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("omnidrive.evaluation.study_report.write_figures", lambda *_: ())
        yield
