"""Small campaigns, flown once for all tests that look at results."""

import pytest

from glider.tools.study.campaign.plan import build_plan, load_campaign, with_options


@pytest.fixture(scope="session")
def plan_of():
    """plan_of(key=value, ...) -> the shipped campaign with a short mission, few seeds and what is given instead."""

    def make(**options):
        small = {"missions": ["spiral"], "seeds": 2, **options}
        return build_plan(with_options(load_campaign("robustness")[0], small))

    return make
