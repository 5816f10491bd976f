#!/usr/bin/env python3
"""Extracts the coastline of Gran Canaria from GSHHG into coast.json.

Needs Debian's packages gmt and gmt-gshhg-full (GSHHG is LGPL-3+; page and console show the attribution).
Usage: extract_coast.py [--rounding METRES] [--tolerance METRES] [--output FILE]

GMT prints the shore cut at the edges of its bins; the pieces are joined by their end points, and rings smaller
than a few hundred metres are left out. The source was traced from a raster of 3 arc seconds (93 m), whose steps
show as a saw where one looks closely: a Gaussian along the shore rounds them, by less than half a step, which is
printed. No detail is gained. What remains is thinned (Douglas-Peucker) by the tolerance.
"""
import argparse
import json
import math
import pathlib
import subprocess
import tempfile

REGION = "-16/-15.2/27.6/28.4"
ATTRIBUTION = "Rounded coast: GSHHG 2.3.7 (Wessel & Smith), LGPL-3+"
SMALLEST_RING_M = 250.0
SAMPLE_M = 10.0
METRES_PER_DEGREE = 111_195.0


def pieces():
    with tempfile.TemporaryDirectory() as folder:  # GMT leaves a file where it works
        text = subprocess.run(["gmt", "coast", f"-R{REGION}", "-Df", "-W1", "-M"], check=True, cwd=folder,
                              capture_output=True, text=True).stdout
    piece = []
    for line in text.splitlines():
        if line.startswith((">", "#")):
            if len(piece) > 1:
                yield piece
            piece = []
        else:
            lon, lat = map(float, line.split()[:2])
            piece.append((round(lon, 5), round(lat, 5)))
    if len(piece) > 1:
        yield piece


def joined(parts):
    parts = [list(p) for p in parts]
    lines = []
    while parts:
        line = parts.pop()
        grown = True
        while grown and line[0] != line[-1]:
            grown = False
            for index, other in enumerate(parts):
                if other[0] == line[-1]:
                    line += other[1:]
                elif other[-1] == line[-1]:
                    line += other[-2::-1]
                elif other[-1] == line[0]:
                    line = other[:-1] + line
                elif other[0] == line[0]:
                    line = other[:0:-1] + line
                else:
                    continue
                parts.pop(index)
                grown = True
                break
        lines.append(line)
    return lines


def metres(point, origin):
    return ((point[0] - origin[0]) * METRES_PER_DEGREE * math.cos(math.radians(origin[1])),
            (point[1] - origin[1]) * METRES_PER_DEGREE)


def thinned(line, tolerance_m):
    keep = {0, len(line) - 1}
    spans = [(0, len(line) - 1)]
    while spans:
        first, last = spans.pop()
        ax, ay = metres(line[first], line[0])
        bx, by = metres(line[last], line[0])
        length = math.hypot(bx - ax, by - ay)
        worst, where = tolerance_m, None
        for i in range(first + 1, last):
            px, py = metres(line[i], line[0])
            off = (abs((bx - ax) * (ay - py) - (ax - px) * (by - ay)) / length if length > 1e-9
                   else math.hypot(px - ax, py - ay))
            if off > worst:
                worst, where = off, i
        if where is not None:
            keep.add(where)
            spans += [(first, where), (where, last)]
    return [line[i] for i in sorted(keep)]


def sampled(ring):
    """The closed ring as points at one distance from each other, in metres from its first."""
    corners = [metres(point, ring[0]) for point in ring]
    lengths = [math.dist(a, b) for a, b in zip(corners, corners[1:])]
    count = max(24, int(sum(lengths) / SAMPLE_M))
    step, points, passed, side = sum(lengths) / count, [], 0.0, 0
    for n in range(count):
        while passed + lengths[side] < n * step and side + 1 < len(lengths):
            passed += lengths[side]
            side += 1
        part = (n * step - passed) / lengths[side] if lengths[side] else 0.0
        (ax, ay), (bx, by) = corners[side], corners[side + 1]
        points.append((ax + (bx - ax) * part, ay + (by - ay) * part))
    return points, step


def rounded(ring, sigma_m):
    """The ring, and by how many metres a point was moved at most."""
    if sigma_m <= 0:
        return ring, 0.0
    points, step = sampled(ring)
    reach = int(3 * sigma_m / step)
    weights = [math.exp(-0.5 * (n * step / sigma_m) ** 2) for n in range(-reach, reach + 1)]
    whole = sum(weights)
    smooth = [tuple(sum(w * points[(n + k - reach) % len(points)][axis] for k, w in enumerate(weights)) / whole
                    for axis in (0, 1)) for n in range(len(points))]
    moved = max(math.dist(a, b) for a, b in zip(points, smooth))
    lon, lat = ring[0]
    narrow = math.cos(math.radians(lat))
    places = [(lon + x / METRES_PER_DEGREE / narrow, lat + y / METRES_PER_DEGREE) for x, y in smooth]
    return places + places[:1], moved


def extent_m(line):
    lons, lats = [p[0] for p in line], [p[1] for p in line]
    return math.hypot(*metres((max(lons), max(lats)), (min(lons), min(lats))))


def main():
    here = pathlib.Path(__file__).resolve().parent
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--rounding", type=float, default=60.0, help="metres along the shore (default 60; 0: none)")
    options.add_argument("--tolerance", type=float, default=4.0, help="metres (default 4)")
    options.add_argument("--output", type=pathlib.Path, default=here / "coast.json")
    chosen = options.parse_args()
    shores = [rounded(line, chosen.rounding) for line in joined(pieces())
              if line[0] == line[-1] and extent_m(line) >= SMALLEST_RING_M]
    rings = [thinned(line, chosen.tolerance) for line, _ in shores]
    rings.sort(key=len, reverse=True)
    features = [{"type": "Feature", "properties": {"name": "Gran Canaria" if n == 0 else "islet"},
                 "geometry": {"type": "Polygon", "coordinates": [[[round(lon, 5), round(lat, 5)] for lon, lat in ring]]}}
                for n, ring in enumerate(rings)]
    collection = {"type": "FeatureCollection", "attribution": ATTRIBUTION, "features": features}
    chosen.output.write_text(json.dumps(collection, separators=(",", ":")) + "\n")
    print(f"{chosen.output}: {len(rings)} rings, {sum(map(len, rings))} points, "
          f"moved by {max(moved for _, moved in shores):.0f} m at most")


if __name__ == "__main__":
    main()
