"""A boat of one equation under thrust and a flap, of which the model knows nothing."""

MODEL = """
import numpy as np
inputs = {"thrust": "N", "flap": "rad"}
outputs = [("speed", "m/s", "speed_m_s", 0.01)]
parameters = [("damping", "1/s", 0.4, 0.1)]
states = [("v", "m/s")]
noises = [("surge", "m/s2", 0.02)]
def derivative(x, u, w, theta):
    return np.array([u[0] - theta[0] * x[0] + w[0]])
def measure(x, u, theta):
    return np.array([x[0]])
"""
