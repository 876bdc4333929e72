"""How many examples a property test tries: its own count under the profile "ci", a multiple of it under "explore"."""

from typing import Any

from hypothesis import settings

CI_EXAMPLES, EXPLORE_EXAMPLES = 100, 1000


def register_profiles() -> None:
    """Register "ci", the same examples in every run, and "explore", ten times as many and others in every run."""
    settings.register_profile("ci", deadline=None, derandomize=True, max_examples=CI_EXAMPLES)
    settings.register_profile(
        "explore", deadline=None, derandomize=False, max_examples=EXPLORE_EXAMPLES, print_blob=True
    )


def examples(count: int = CI_EXAMPLES, **more: Any) -> settings:
    """Return the settings of a test that tries `count` examples under "ci"; more: other settings of Hypothesis."""
    return settings(max_examples=count * settings.default.max_examples // CI_EXAMPLES, **more)
