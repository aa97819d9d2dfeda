"""The drawing of the six sides and the three turns of an IMU: python docs/pictures/sides_and_turns.py

An arrow of each axis of the case, drawn from one corner of a box; up is up on the page.
"""

from pathlib import Path

import numpy as np

WIDTH, ROW, SIZE = 150, 158, 30
COLOURS = {"x": "#b5442e", "y": "#3c7a3f", "z": "#2d5f9a"}
#: axes x, y, z of the case (columns) on east, north, up of the page, with the named axis up
UP = {
    "+x": ((0, 1, 0), (0, 0, 1), (1, 0, 0)), "-x": ((0, 1, 0), (0, 0, -1), (-1, 0, 0)),
    "+y": ((0, 0, 1), (1, 0, 0), (0, 1, 0)), "-y": ((0, 0, -1), (1, 0, 0), (0, -1, 0)),
    "+z": ((1, 0, 0), (0, 1, 0), (0, 0, 1)), "-z": ((1, 0, 0), (0, -1, 0), (0, 0, -1)),
}  # fmt: skip
EAST, NORTH, HIGH = np.array([0.88, -0.22]), np.array([0.45, 0.38]), np.array([0.0, 1.0])


def on_page(vector, centre):
    """A vector on east, north, up, at a centre of the page."""
    east, north, up = vector
    flat = east * EAST + north * NORTH + up * HIGH
    return centre + SIZE * np.array([flat[0], -flat[1]])


def line(a, b, colour, width=1.2, more=""):
    """A line from a to b."""
    ends = f'x1="{a[0]:.1f}" y1="{a[1]:.1f}" x2="{b[0]:.1f}" y2="{b[1]:.1f}"'
    return f'<line {ends} stroke="{colour}" stroke-width="{width}"{more}/>'


def text(at, words, colour="#222", size=12, anchor="middle"):
    """Words at a place."""
    where = f'x="{at[0]:.1f}" y="{at[1]:.1f}" font-size="{size}"'
    return f'<text {where} fill="{colour}" text-anchor="{anchor}">{words}</text>'


def box(centre, side):
    """The case with a side up, and the arrows of its axes."""
    C = np.array(UP[side], dtype=float)
    half = np.array([1.0, 0.8, 0.5])  # x, y, z of the case
    corners = [np.array([i, j, k]) for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)]
    out = []
    for a in corners:
        for b in corners:
            if np.sum(a != b) == 1 and tuple(a) < tuple(b):
                ends = (on_page(C @ (half * a), centre), on_page(C @ (half * b), centre))
                out.append(line(*ends, "#8a8a8a", 1))
    for k, letter in enumerate("xyz"):
        axis = np.eye(3)[k]
        start, end = on_page(C @ (half * axis), centre), on_page(C @ ((half[k] + 0.75) * axis), centre)
        out.append(line(start, end, COLOURS[letter], 2, f' marker-end="url(#{letter})"'))
        out.append(text(end + (end - start) * 0.42 + [0, 4], letter, COLOURS[letter]))
    return out


def turn(centre):
    """An arrow around the vertical, against the clock seen from above."""
    a = np.radians(np.linspace(-35.0, 255.0, 40))
    points = [on_page(1.75 * np.array([np.cos(x), np.sin(x), 0.0]) - [0.0, 0.0, 0.45], centre) for x in a]
    path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    return [
        f'<polyline points="{path}" fill="none" stroke="#222" stroke-width="1.6" marker-end="url(#turn)"/>'
    ]


def main():
    """Draw, and write the picture beside this file."""
    marks = "".join(
        f'<marker id="{name}" viewBox="0 0 8 8" refX="6" refY="4" markerWidth="5" markerHeight="5" orient="auto">'
        f'<path d="M0,0 L8,4 L0,8 z" fill="{colour}"/></marker>'
        for name, colour in {**COLOURS, "turn": "#222"}.items()
    )
    out = []
    names = {"+x": "x_up", "-x": "x_down", "+y": "y_up", "-y": "y_down", "+z": "z_up", "-z": "z_down"}
    for k, side in enumerate(UP):
        centre = np.array([WIDTH * (k % 3) + WIDTH / 2, ROW * (k // 3) + 70.0])
        out += box(centre, side)
        out.append(text(np.add(centre, (0, 82)), f"{names[side]}.csv"))
    for k, letter in enumerate("xyz"):
        centre = np.array([WIDTH * k + WIDTH / 2, 2 * ROW + 74.0])
        out += box(centre, f"+{letter}") + turn(centre)
        out.append(text(np.add(centre, (0, 78)), f"{letter}_360deg.csv"))
    height = 3 * ROW + 16
    size = f'viewBox="0 0 {3 * WIDTH} {height}" width="{3 * WIDTH}" height="{height}"'
    svg = (
        f'<svg xmlns="http://www.w3.org/2000/svg" {size} '
        'font-family="sans-serif"><title>Six sides of a case with the named axis up, and a turn about each axis</title>'
        f'<rect width="100%" height="100%" fill="#fff"/><defs>{marks}</defs>{"".join(out)}</svg>\n'
    )
    Path(__file__).with_name("sides-and-turns.svg").write_text(svg, encoding="utf-8")


if __name__ == "__main__":
    main()
