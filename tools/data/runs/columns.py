"""Columns of run data: their names (each carries its unit), their groups, and what is read as a number.

A column named here is a number with missing samples; every other column of a file is kept as text and ignored.
"""

TIME = "t_s"
COMMANDS = ("cmd_servo_rad", "cmd_slider_m", "cmd_ballast_kg")
DRAW_WIRES = ("slider_m", "ballast_kg")
ATTITUDE = ("roll_rad", "pitch_rad", "yaw_rad")
RATES = ("p_rad_s", "q_rad_s", "r_rad_s")
DEPTH = "depth_m"
MOCAP_POSITION = ("mocap_x_m", "mocap_y_m", "mocap_z_m")
MOCAP_ATTITUDE = ("mocap_roll_rad", "mocap_pitch_rad", "mocap_yaw_rad")
MOCAP = MOCAP_POSITION + MOCAP_ATTITUDE
# Of ocean gliders: buoyancy engine, pitch mass and rudder, the water where they are, speed through it.
OIL, BATTERY, FIN = "oil_m3", "battery_m", "fin_rad"
DENSITY, TEMPERATURE, PUMP = "density_kg_m3", "temperature_c", "pump"
SPEED, VELOCITY = "speed_m_s", ("vn_m_s", "ve_m_s")
OCEAN = (OIL, BATTERY, FIN, DENSITY, TEMPERATURE, PUMP, SPEED, *VELOCITY)

# In the order in which they are written.
ALL = (TIME, *COMMANDS, *DRAW_WIRES, *ATTITUDE, *RATES, DEPTH, *MOCAP, *OCEAN)
KNOWN = frozenset(ALL)
# Angles that may wrap from pi to -pi between two samples; means and differences must not cross that jump.
WRAPPING = frozenset((*ATTITUDE, *MOCAP_ATTITUDE))


def in_order(names: list[str]) -> list[str]:
    """Known names in the order of this file, then the others as they came."""
    known = [name for name in ALL if name in names]
    return known + [name for name in names if name not in KNOWN]
