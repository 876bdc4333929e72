"""Flight software, simulator and sim-to-real diagnosis of an underwater glider.

Its subpackages are `glider.firmware`, `glider.hal`, `glider.sim_backend` and `glider.tools`. In the source tree these
are symbolic links to the folders beside this one. An installation therefore holds one top-level package: it cannot
shadow another distribution's `hal` or `tools`, nor be shadowed by one.
"""
