"""Systems to run the programs on: this one as it is, and others that are pretended."""

import sys

import pytest

from tests.system.programs import System

PRETENDED = ("windows", "macos")


@pytest.fixture(params=PRETENDED)
def elsewhere(request, tmp_path):
    if sys.platform != "linux":
        pytest.skip("other systems are pretended on Linux; this one is tested as it is")
    return System(request.param, tmp_path)


@pytest.fixture
def here(tmp_path):
    return System("here", tmp_path)
