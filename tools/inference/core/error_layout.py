"""Where things stand in the errors of a state that the filter follows, and in its process noise.

Errors (N_ERR): position (NED, m), attitude (rotation vector, body, rad), nu, servo, slider, ballast, as the flying
filter has them; then how late motion capture is (s). Behind them, where the filter finds it, what the model lacks
(core/model_error).
"""

from glider.firmware.core.layouts.estimator_layout import E_ACT, E_ATT, E_NU, E_POS

__all__ = ["E_ACT", "E_ATT", "E_DOWN", "E_LATE", "E_NU", "E_POS", "N_ERR", "N_PATH", "N_SPECTRAL", "Q_ACC", "Q_ACT",
           "Q_LATE", "Q_POS"]  # fmt: skip

E_DOWN = E_POS + 2
E_LATE = E_ACT + 3  # motion capture's clock: it walks, and moves nothing but what is read
N_ERR = E_LATE + 1

# --- spectral densities: accelerations ((m/s2)2 s, (rad/s2)2 s), and walks, the error's unit squared a second ---------
Q_ACC, Q_ACT, Q_POS, Q_LATE = 0, 6, 9, 12
N_SPECTRAL = 13

N_PATH = 6  # the path flown without the filter's corrections: position, roll, pitch, yaw
