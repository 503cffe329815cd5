"""Binaries compiled for the tests go to a cache of their own, once a run."""

import pytest

from mbsvib_export.fmu_.binaries import CACHE_VARIABLE


@pytest.fixture(autouse=True, scope="session")
def _own_cache(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(CACHE_VARIABLE, str(tmp_path_factory.mktemp("cache")))
        yield
