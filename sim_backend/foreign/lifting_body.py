"""Forces of the water on a glider put together from hull, wings and fins: another form than equation (4).

Every element takes the velocity of its own place, V + Omega x r, so that rates damp with the speed, and a part of them
without it. Lift acts across that velocity and drag against it: the water never adds energy. The velocity potential's
part (added masses, Munk's moment) is in the plant's equation of motion.

Hull: friction by the ITTC line (1957) with Hoerner's form factor (1965); viscous cross-flow and the lift of the tail's
base by Allen and Perkins (1951), the cross-flow coefficient growing with the local angle of the flow. Wings and fins:
lift slope by Helmbold (1942), induced drag by a parabolic polar (Prandtl 1918), friction by Blasius (1908), beyond the
stall by Viterna and Corrigan (1982); the tail flies in the wings' downwash.
"""

import math

from glider.firmware.core.jit import kernel
from glider.sim_backend.foreign import foreign_layout as fo

DENSITY, VISCOSITY = 998.0, 1.05e-6  # kg/m3, m2/s: fresh water at 18 deg C
LEAST_HULL, LEAST_WING = 2e4, 1e3  # Reynolds numbers below which friction coefficients grow no more
STRIPS = 8  # of the hull, for the cross-flow
STILL_SPEED = 1e-9  # m/s; below this nothing flows
BLEND = 0.06  # rad over which a lift curve bends into its stall
SIDED_FRICTION, SIDED_ANGLE = 0.01, 4.0  # what fouls one wing: drag coefficient, and per rad2


@kernel
def ittc_friction(reynolds):
    """Friction coefficient of a turbulent plate by the ITTC line of 1957."""
    decades = math.log10(max(reynolds, LEAST_HULL)) - 2.0
    return 0.075 / (decades * decades)


@kernel
def blasius_friction(reynolds):
    """Friction coefficient of a laminar plate, one side."""
    return 1.328 / math.sqrt(max(reynolds, LEAST_WING))


@kernel
def helmbold_slope(aspect):
    """Lift slope of a straight wing of finite aspect ratio, 1/rad."""
    return 2.0 * math.pi * aspect / (2.0 + math.sqrt(4.0 + aspect * aspect))


@kernel
def stalled(angle, aspect, stall, lift_at_stall, drag_at_stall):
    """Lift and drag coefficient at an angle of the flow from 0 to pi / 2 beyond the stall, by Viterna and Corrigan."""
    most = 1.11 + 0.018 * aspect
    s, c, ss, cs = math.sin(angle), math.cos(angle), math.sin(stall), math.cos(stall)
    a2 = (lift_at_stall - most * ss * cs) * ss / (cs * cs)
    b2 = (drag_at_stall - most * ss * ss) / cs
    return most * s * c + a2 * c * c / max(s, 0.5 * ss), most * s * s + b2 * c


@kernel
def section(angle, aspect, stall, friction, oswald):
    """Lift and drag coefficient of a surface at an effective angle (rad, any) of the flow to its chord."""
    away = abs(angle)
    behind = away > 0.5 * math.pi  # flown backwards: a poorer wing
    if behind:
        away = math.pi - away
    slope = helmbold_slope(aspect)
    lift_at_stall = slope * stall
    drag_at_stall = friction + lift_at_stall * lift_at_stall / (math.pi * aspect * oswald)
    lift = slope * away
    drag = friction + lift * lift / (math.pi * aspect * oswald)
    if away > stall - BLEND:
        deep_lift, deep_drag = stalled(max(away, stall), aspect, stall, lift_at_stall, drag_at_stall)
        share = min(1.0, (away - stall + BLEND) / (2.0 * BLEND))
        share = share * share * (3.0 - 2.0 * share)
        lift = (1.0 - share) * min(lift, 1.2 * lift_at_stall) + share * deep_lift
        drag = (1.0 - share) * drag + share * deep_drag
    if behind:
        lift *= -0.7
    return math.copysign(1.0, angle) * lift, max(drag, friction)


@kernel
def surface_force(F, number, more_lift, extra_friction, extra_angle, wash, u, v, w, p, q, r):
    """Force of one surface (body axes) and its lift coefficient.

    more_lift: share by which its lift is more; extra_friction, extra_angle: drag coefficient more, and per rad2; wash:
    angle (rad) by which what flies ahead turns the flow down.
    """
    at = fo.FB_SURFACES + number * fo.N_FBS
    x, y, z = F[at + fo.FBS_X], F[at + fo.FBS_Y], F[at + fo.FBS_Z]
    ul, vl, wl = u + q * z - r * y, v + r * x - p * z, w + p * y - q * x
    ny, nz = math.sin(F[at + fo.FBS_TILT]), math.cos(F[at + fo.FBS_TILT])
    across = ny * vl + nz * wl
    speed = math.sqrt(ul * ul + across * across)
    if speed < STILL_SPEED:
        return 0.0, 0.0, 0.0, 0.0
    turned = math.atan2(across, ul + 0.0)
    angle = turned + F[at + fo.FBS_INCIDENCE] - wash
    if angle > math.pi:
        angle -= 2.0 * math.pi
    elif angle < -math.pi:
        angle += 2.0 * math.pi
    friction = 2.0 * blasius_friction(speed * F[at + fo.FBS_CHORD] / VISCOSITY) * F[at + fo.FBS_FRICTION]
    stall = F[at + fo.FBS_STALL]
    if F[fo.FS_STALL] > 0.0 and number <= fo.SURFACE_PORT:
        stall = min(stall, 1.0 / F[fo.FS_STALL])
    lift, drag = section(angle, F[at + fo.FBS_ASPECT], stall, friction * (1.0 + F[fo.FS_DRAG]), F[at + fo.FBS_OSWALD])
    lift *= 1.0 + more_lift
    drag += extra_friction + extra_angle * turned * turned
    pressure = 0.5 * DENSITY * F[at + fo.FBS_AREA] * speed
    ahead = pressure * (lift * across - drag * ul)
    normal = pressure * (-lift * ul - drag * across)
    return ahead, ny * normal, nz * normal, lift


@kernel
def add_at(x, y, z, X, Y, Z, wrench):
    """A wrench (six numbers) with a force at a place added."""
    F1, F2, F3, T1, T2, T3 = wrench
    return F1 + X, F2 + Y, F3 + Z, T1 + y * Z - z * Y, T2 + z * X - x * Z, T3 + x * Y - y * X


@kernel
def hull_wrench(F, u, v, w, p, q, r):
    """Friction, cross-flow, lift of the base, what stands out, and drag of the rolling: six numbers, body axes."""
    length, half = F[fo.FB_LENGTH], 0.5 * DENSITY
    fouled = 1.0 + F[fo.FS_DRAG]
    friction = ittc_friction(abs(u) * length / VISCOSITY) * F[fo.FB_FORM_FACTOR] * F[fo.FB_WETTED]
    wrench = (-half * friction * fouled * abs(u) * u, 0.0, 0.0, -F[fo.FB_ROLL_DRAG] * abs(p) * p, 0.0, 0.0)
    for i in range(STRIPS):
        place = (i + 0.5) / STRIPS - 0.5
        x, wide = place * length, F[fo.FB_DIAMETER] * math.sqrt(1.0 - (2.0 * place) ** 6)
        vi, wi = v + r * x, w - q * x
        across = vi * vi + wi * wi
        bent = across / (across + u * u + STILL_SPEED)  # the local angle's sine, squared
        coefficient = F[fo.FB_CROSS_ALONG] + (F[fo.FB_CROSS_ACROSS] - F[fo.FB_CROSS_ALONG]) * bent
        pull = half * coefficient * wide * length / STRIPS * math.sqrt(across)
        wrench = add_at(x, 0.0, 0.0, 0.0, -pull * vi, -pull * wi, wrench)
    x = F[fo.FB_BASE_X]
    vb, wb = v + r * x, w - q * x
    angle = math.atan2(math.sqrt(vb * vb + wb * wb), abs(u))
    pull = 2.0 * half * F[fo.FB_APPARENT] * F[fo.FB_BASE_AREA] * abs(u) * math.cos(0.5 * angle)
    wrench = add_at(x, 0.0, 0.0, 0.0, -pull * vb, -pull * wb, wrench)
    x, z = F[fo.FB_MAST_X], F[fo.FB_MAST_Z]
    um, vm, wm = u + q * z, v + r * x - p * z, w - q * x
    pull = half * F[fo.FB_MAST_AREA] * fouled * math.sqrt(um * um + vm * vm + wm * wm)
    return add_at(x, 0.0, z, -pull * um, -pull * vm, -pull * wm, wrench)


@kernel
def body_wrench(F, u, v, w, p, q, r):
    """Force (N) and moment (N m) of the water on the whole vehicle, body axes; velocities are relative to the water.

    F[FS_DRAG] fouls all friction, F[FS_LIFT] is lift more or less of the wings, F[FS_WEATHERCOCK] of the fin,
    F[FS_STALL] stalls the wings at 1 / F (rad), F[FS_SIDED_FOULING] grows on the starboard wing.
    """
    wrench, lifts = hull_wrench(F, u, v, w, p, q, r), 0.0
    for number in range(4):
        at, more, extra, wash = fo.FB_SURFACES + number * fo.N_FBS, 0.0, 0.0, 0.0
        if number <= fo.SURFACE_PORT:
            more = F[fo.FS_LIFT]
            extra = F[fo.FS_SIDED_FOULING] if number == fo.SURFACE_STARBOARD else 0.0
        elif number == fo.SURFACE_FIN:
            more = F[fo.FS_WEATHERCOCK]
        elif u > 0.0:
            wing = fo.FB_SURFACES + fo.SURFACE_STARBOARD * fo.N_FBS
            wash = F[fo.FB_DOWNWASH] * lifts / (math.pi * F[wing + fo.FBS_ASPECT])
        X, Y, Z, lift = surface_force(
            F, number, more, SIDED_FRICTION * extra, SIDED_ANGLE * extra, wash, u, v, w, p, q, r
        )  # fmt: skip
        lifts += lift
        wrench = add_at(F[at + fo.FBS_X], F[at + fo.FBS_Y], F[at + fo.FBS_Z], X, Y, Z, wrench)
    return wrench
