"""Tests; their parts are imported as tests.support and tests.independent."""
