"""A suspension footbridge under people who walk across it: peak tensions, and a picture.

    python examples/python/footbridge.py [FOLDER]

writes footbridge.svg, its springs coloured by their peak tension, and footbridge.html, the
run to look at.
"""

import sys
from pathlib import Path

import numpy as np
import springs as sp

SPAN, WIDTH, SAG, BAY = 30.0, 1.6, 3.0, 1.5  # m
NODE_MASS = 60.0  # kg of deck
GRAVITY = 9.81

# People: how fast they walk (m/s), how often they step (Hz), what they weigh (N), and the
# part of their weight that goes up and down with each step.
SPEED, PACE, WEIGHT, BOUNCE = 1.5, 1.8, 750.0, 0.4
STARTS = [0.0, 1.0, 2.5]  # s
DURATION = 14.0


def bridge():
    """The scene; the deck's nodes (2, m) and the springs of cables, hangers and deck."""
    m = round(SPAN / BAY) + 1
    along = np.linspace(0, SPAN, m)
    s = sp.Scene(gravity=(0, 0, -GRAVITY), name="footbridge", damping=(0.05, 0))
    deck, cable = [], []
    for y in [0, WIDTH]:
        level = np.zeros(m)
        deck.append(s.nodes(np.stack([along, np.full(m, y), level], 1), mass=NODE_MASS))
        height = 0.8 + SAG * (2 * along / SPAN - 1) ** 2
        cable.append(s.nodes(np.stack([along, np.full(m, y), height], 1), mass=4.0))
    deck, cable = np.array(deck), np.array(cable)

    def pairs(first, second):
        return np.stack([np.ravel(first), np.ravel(second)], axis=1)

    # As long as in the drawing under the dead load of a parabolic cable.
    weight = (NODE_MASS + 4.0) * GRAVITY / BAY
    horizontal = weight * SPAN**2 / (8 * SAG)
    slope = np.diff(0.8 + SAG * (2 * along / SPAN - 1) ** 2) / BAY
    pull = np.tile(horizontal * np.sqrt(1 + slope**2), 2)
    groups = {
        "cables": s.springs(
            pairs(cable[:, :-1], cable[:, 1:]), stiffness=2e7, pretension=pull, damping_ratio=0.01
        ),
        "hangers": s.springs(
            pairs(deck[:, 1:-1], cable[:, 1:-1]),
            stiffness=2e6,
            pretension=NODE_MASS * GRAVITY,
            damping_ratio=0.01,
        ),
        "deck": np.concatenate(
            [
                s.springs(pairs(deck[:, :-1], deck[:, 1:]), stiffness=2e6, damping_ratio=0.02),
                s.springs(pairs(deck[0], deck[1]), stiffness=1e7),
                s.springs(pairs(deck[0, :-1], deck[1, 1:]), stiffness=1e6),
            ]
        ),
    }
    # Wind ropes keep the cables upright.
    s.springs(pairs(cable[0], cable[1]), stiffness=1e6)
    s.fix(deck[:, [0, -1]].ravel())
    s.fix(cable[:, [0, -1]].ravel())
    return s, deck, groups


def walk(s, deck, start, side):
    """Loads the deck's nodes with somebody who starts to walk at a time: a node bears the
    part of the weight that is near it."""
    times = np.arange(0, DURATION + 1e-9, 1 / 60)
    place = SPEED * (times - start)
    force = WEIGHT * (1 + BOUNCE * np.sin(2 * np.pi * PACE * (times - start)))
    for node, x in zip(deck[side], np.linspace(0, SPAN, deck.shape[1])):
        share = np.clip(1 - np.abs(place - x) / BAY, 0, None)
        on = np.flatnonzero(share > 0)
        if on.size:
            # A little before and after, where it bears nothing.
            window = slice(max(on[0] - 1, 0), on[-1] + 2)
            down = np.zeros((times[window].size, 3))
            down[:, 2] = -(force * share)[window]
            s.load(int(node), down, times[window])


def picture(path, x, ij, peak):
    """The bridge from the side, its springs from blue (slack) to red (the most)."""
    flat = np.stack([x[:, 0] + 0.35 * x[:, 1], -x[:, 2] - 0.35 * x[:, 1]], axis=1)
    low, high = flat.min(0) - 1, flat.max(0) + 1
    width, height = high - low
    lines = []
    for (i, j), part in zip(ij, np.clip(peak / peak.max(), 0, 1)):
        color = f"hsl({240 * (1 - part):.0f},80%,45%)"
        (x1, y1), (x2, y2) = flat[i], flat[j]
        lines.append(
            f'<line x1="{x1:.3f}" y1="{y1:.3f}" x2="{x2:.3f}" y2="{y2:.3f}" stroke="{color}"/>'
        )
    Path(path).write_text(
        f'<svg xmlns="http://www.w3.org/2000/svg" width="1200" '
        f'viewBox="{low[0]:.2f} {low[1]:.2f} {width:.2f} {height:.2f}">'
        f'<rect x="{low[0]:.2f}" y="{low[1]:.2f}" width="{width:.2f}" height="{height:.2f}" fill="white"/>'
        f'<g stroke-width="0.08" stroke-linecap="round">{"".join(lines)}</g></svg>\n'
    )


def main(folder="."):
    s, deck, groups = bridge()
    rest = s.settle()
    for side, start in enumerate(STARTS):
        walk(s, deck, start, side % 2)
    r = s.run(DURATION, start=rest, step=1 / 120, method="tr-bdf2", frames=int(30 * DURATION))
    peak = r.tension.max(axis=0)
    middle = deck[0, deck.shape[1] // 2]
    sag = (rest.x[middle, 2] - r.x[:, middle, 2]).max()
    found = {"sag": sag, "tension at rest": {}, "peak": {}}
    print(f"the deck goes down by {1000 * sag:.0f} mm in the middle")
    for name, springs in groups.items():
        before, most = rest.tension[springs].max(), peak[springs].max()
        print(f"{name}: {before / 1000:.2f} kN at rest, {most / 1000:.2f} kN at most")
        found["tension at rest"][name], found["peak"][name] = before, most
    folder = Path(folder)
    picture(folder / "footbridge.svg", rest.x, s.ij, peak)
    r.view(folder / "footbridge.html")
    return found


if __name__ == "__main__":
    main(*sys.argv[1:])
