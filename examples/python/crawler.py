"""A robot that crawls by actuated rest lengths, to where it is told to, in a closed loop.

    python examples/python/crawler.py

Five weights in a row lie on the ground and are joined by four actuators. Bristles under the
weights slide more easily forwards than backwards. A wave of rest lengths runs through the
actuators; the controller looks where the robot is, and makes the wave smaller as it comes
near its target, and stops there.
"""

import numpy as np
import springs as sp

N, LENGTH, MASS = 5, 0.2, 0.3  # weights, m, kg
FORWARDS, BACKWARDS = 0.15, 0.9  # coefficients of friction
GRAVITY = 9.81
TARGET = 1.0  # m from the start, of the middle of the robot
STEP = 1 / 480


def robot():
    s = sp.Scene(name="crawler")
    x = np.zeros((N, 3))
    x[:, 0] = LENGTH * np.arange(N)
    s.nodes(x, mass=MASS)
    pairs = np.stack([np.arange(N - 1), np.arange(1, N)], axis=1)
    s.springs(pairs, stiffness=400.0, damping_ratio=0.3)
    return s


def friction(v):
    """Of bristles, in N: by the direction of sliding, smooth about rest."""
    coefficient = np.where(v[:, 0] > 0, FORWARDS, BACKWARDS)
    force = np.zeros_like(v)
    force[:, 0] = -coefficient * MASS * GRAVITY * np.tanh(v[:, 0] / 0.02)
    return force


def policy(time, place):
    """Rest lengths of the actuators, when the middle of the robot is at a place."""
    amplitude = 0.25 * np.clip((TARGET - place) / 0.1, 0, 1)
    phase = 2 * np.pi * (1.5 * time + np.arange(N - 1) / (N - 1))
    return LENGTH * (1 + amplitude * np.sin(phase))


def main():
    places = []
    with robot().simulation(step=STEP, method="tr-bdf2") as sim:
        start = sim.x[:, 0].mean()
        while sim.time < 20:
            place = sim.x[:, 0].mean() - start
            places.append(place)
            sim.force = friction(sim.v)
            sim.rest_length = policy(sim.time, place)
            sim.advance(STEP)
        energy = sim.energy
    places = np.array(places)
    arrived = STEP * np.argmax(places > 0.95 * TARGET)
    print(f"it is {places[-1]:.3f} m from its start, for a target of {TARGET} m")
    print(f"it has gone 95 % of that after {arrived:.1f} s, at {0.95 * TARGET / arrived:.3f} m/s")
    print(f"the actuators did {energy['control_work']:.2f} J of work: friction took")
    print(f"{-energy['load_work']:.2f} J, and their own damping {energy['dashpot_heat']:.2f} J")
    return {"place": places[-1], "arrived": arrived, "energy": energy}


if __name__ == "__main__":
    main()
