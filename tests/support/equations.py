"""Equations of the paper that tests hold the law to, and that nothing flies with."""

import math


def k2_by_29(error_rate, reference_acc, f, g, k1):
    """Smallest k2 of (29), |k1 e_d - x_dd_ref + f| / |g|, in the input's unit; infinite where g = 0.

    For the sliding term alone, without (32); f holds the other input's share, f_i + g_ij u_j.
    """
    return math.inf if g == 0.0 else abs(k1 * error_rate - reference_acc + f) / abs(g)
