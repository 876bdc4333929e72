"""The chain command -> actuator -> force and moment -> motion -> sensor: its stages, and where a place belongs."""

COMMAND, ACTUATOR, FORCE, MOTION, SENSOR = STAGES = ("command", "actuator", "force and moment", "motion", "sensor")
STAGE_OF_PLACE = {
    "actuation": ACTUATOR, "hydrodynamics": FORCE, "mass": FORCE, "environment": MOTION, "sensing": SENSOR
}  # fmt: skip


def stage_of(subsystem: str, element: str) -> str:
    """The stage of the chain that a place belongs to."""
    if subsystem == "timing":
        return COMMAND if element == "command" else SENSOR
    if (subsystem, element) == ("mass", "inertia"):
        return MOTION
    return STAGE_OF_PLACE[subsystem]
