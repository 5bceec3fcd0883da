"""Tests of `roost.client` against real servers and workers."""
