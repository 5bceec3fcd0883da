#!/usr/bin/env python3
"""The longest stable time step of an endless lattice, from the eigenvalues of one step of leapfrog.

    python3 -m venv venv && venv/bin/pip install numpy && venv/bin/python limits.py > limits.csv

Sub-particles stand on a cubic lattice of bonds, with contact between neighbours that overlap by R. For each of a grid of wave
vectors a step is a matrix of 12 x 12, of three displacements and three turns and their velocities: it is stable while no eigenvalue
leaves the unit circle. Nothing here is taken from the solver: the laws are written out anew.
"""

import cmath
import itertools
import math

import numpy as np

E, POISSON, DENSITY = 48_600.0, 0.37, 2200.0  # Pa, kg/m3: Table 2
E_STAR = E / (2.0 * (1.0 - POISSON**2))
G_STAR = E / (2.0 * (1.0 + POISSON)) / (2.0 * (2.0 - POISSON))
ALONG, ACROSS = 0.4, 0.2  # shares of a motion that a dashpot takes in a step


class Lattice:
    def __init__(self, radius, stiffness, restitution):
        self.radius = radius
        self.mass = DENSITY * 4.0 / 3.0 * math.pi * radius**3
        a = math.sqrt(radius / 2.0 * radius)
        self.contact = (2.0 * E_STAR * a, 8.0 * G_STAR * a)
        self.bond = tuple(s * math.pi * radius**2 for s in stiffness)
        beta = math.log(restitution) / math.hypot(math.log(restitution), math.pi)
        self.damping = 2.0 * math.sqrt(5.0 / 6.0) * abs(beta)

    def dashpots(self, dt):
        m_star = self.mass / 2.0
        most = (ALONG * m_star / dt, ACROSS * m_star / (3.5 * dt))
        return [min(self.damping * math.sqrt(k * m_star), limit) for k, limit in zip(self.contact, most)]

    def matrix(self, along, across, wave):
        """Forces and moments from displacements and turns, all of them opposed."""
        opposed = np.zeros((6, 6), complex)
        for axis, sign in itertools.product(range(3), (1.0, -1.0)):
            n = sign * np.eye(3)[axis]
            phase = cmath.exp(1j * sign * wave[axis])
            arm = np.array([[0, -n[2], n[1]], [n[2], 0, -n[0]], [-n[1], n[0], 0]]) * self.radius
            # Where the two meet: the other's motion there against its own.
            meets = np.hstack([(phase - 1.0) * np.eye(3), (1.0 + phase) * arm])
            force = (along * np.outer(n, n) + across * (np.eye(3) - np.outer(n, n))) @ meets
            opposed -= np.vstack([force, arm @ force])
        return opposed

    def is_stable(self, dt):
        stiffness = [k + s for k, s in zip(self.contact, self.bond)]
        dashpots = self.dashpots(dt)
        inverse = np.diag([1.0 / self.mass] * 3 + [1.0 / (0.4 * self.mass * self.radius**2)] * 3)
        for wave in WAVES:
            pull = dt * inverse @ self.matrix(*stiffness, wave)
            slow = np.eye(6) - dt * inverse @ self.matrix(*dashpots, wave)
            step = np.block([[np.eye(6) - dt * pull, dt * slow], [-pull, slow]])
            if max(abs(np.linalg.eigvals(step))) > 1.0 + 1e-6:
                return False
        return True

    def limit(self):
        low, high = 1e-6, 1e-2
        for _ in range(30):
            dt = math.sqrt(low * high)
            low, high = (dt, high) if self.is_stable(dt) else (low, dt)
        return low


WAVES = [[math.pi * k / 4.0 for k in wave] for wave in itertools.combinations_with_replacement(range(5), 3)]

# Normal and across, in N/m3: of Table 2, where the fastest mode spins all alike; and one where it moves neighbours apart.
STIFFNESSES = [(1e6, 6e5), (1e7, 0.0)]

print("radius_m,normal_stiffness_n_m3,shear_stiffness_n_m3,restitution,limit_s")
for radius, (normal, shear) in itertools.product((0.004, 0.006), STIFFNESSES):
    for restitution in (1e-4, 0.1, 0.3, 0.5, 0.8, 0.999):
        limit = Lattice(radius, (normal, shear), restitution).limit()
        print(f"{radius},{normal},{shear},{restitution},{limit:.4e}")
