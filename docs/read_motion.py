"""Positions and orientations (x y z w) of the Gaussians of a gsburn .glb at a time: python3 read_motion.py scene.glb 0.5"""
import json, math, struct, sys
def read(path):
    data = open(path, "rb").read()
    length = struct.unpack_from("<I", data, 12)[0]
    doc, buffer = json.loads(data[20:20 + length]), data[28 + length:]
    def accessor(index):
        a = doc["accessors"][index]
        width, code = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[a["type"]], {5121: "B", 5125: "I", 5126: "f"}[a["componentType"]]
        flat = struct.unpack_from(f"<{a['count'] * width}{code}", buffer, doc["bufferViews"][a["bufferView"]]["byteOffset"])
        return list(flat) if width == 1 else [list(flat[i:i + width]) for i in range(0, len(flat), width)]
    return doc["meshes"][0]["primitives"][0], accessor

def function(f, s):  # A time function at s, with its return to a straight line where |s| > 1.
    if abs(s) > 1 and "beyond" in f:
        (offset, slope), fade = f["beyond"]["line"], f["beyond"]["fade"]
        value, steepness = f["beyond"]["edges"][s > 0]
        edge, x = math.copysign(1, s), min((abs(s) - 1) / fade, 1)
        excess, drift = value - (offset + slope * edge), (steepness - slope) * edge * fade
        return offset + slope * s + excess * (1 + x * x * (2 * x - 3)) + drift * x * (1 - x) ** 2
    if "ramp" in f:  # At rest, then a parabola from near to far, then a line of slope 1 outwards.
        s, near, far = s * math.copysign(1, f["ramp"][1]), abs(f["ramp"][0]), abs(f["ramp"][1])
        return 0.5 * min(max((s - near) / (far - near), 0), 1) ** 2 * (far - near) + max(s - far, 0)
    return s ** f["power"] * ((math.sin if f["of"] == "sine" else math.cos)(math.pi * f["wave"] * s) if "wave" in f else 1)

def product(p, q):  # Quaternions: first the turn q, then p.
    (a, b, c, d), (x, y, z, w) = p, q
    return [d*x + a*w + b*z - c*y, d*y - a*z + b*w + c*x, d*z + a*y - b*x + c*w, d*w - a*x - b*y - c*z]

def turn(r, sign=1):  # exp(r / 2) of a rotation vector, or its inverse.
    angle = math.hypot(*r)
    return [sign * x * (math.sin(angle / 2) / angle if angle > 1e-12 else 0.5) for x in r] + [math.cos(angle / 2)]

def at(path, t):
    primitive, accessor = read(path)
    points, quats = [accessor(primitive["attributes"][name]) for name in ("POSITION", "KHR_gaussian_splatting:ROTATION")]
    motion = primitive["extensions"]["GSBURN_gaussian_motion"]
    rows = accessor(motion["rows"])
    if "keys" in motion:  # Straight lines between key frames, at rest before and after; rotations by the shorter way.
        times, places, turns = motion["keys"]["times"], *[accessor(motion["keys"][k]) for k in ("positions", "rotations")]
        b = min(max(sum(time <= t for time in times), 1), len(times) - 1)
        a, m = max(b - 1, 0), len(rows)
        x = min(max((t - times[a]) / (times[b] - times[a]), 0), 1) if b > a else 0
        mix = lambda p, q, sign=1: [(1 - x) * u + x * sign * v for u, v in zip(p, q)]
        for i, row in enumerate(rows):
            p, q = turns[a * m + i], turns[b * m + i]
            mixed = mix(p, q, math.copysign(1, sum(u * v for u, v in zip(p, q))))
            points[row], quats[row] = mix(places[a * m + i], places[b * m + i]), [u / math.hypot(*mixed) for u in mixed]
        return points, quats
    s, middle = [(time - motion["window"]["t0"]) / motion["window"]["half"] for time in (t, motion["middle"])]
    bodies = motion.get("bodies", {"scales": []})
    def bases(row):  # 1 and the offset from the centre of the row's body, and which body that is.
        b = accessor(bodies["of"])[row] if "of" in bodies else 255
        return (b, [1] + [(x - c) / bodies["scales"][b] for x, c in zip(points[rows[row]], bodies["centres"][b])]) if b < 255 else (b, [])
    based = [bases(i) for i in range(len(rows))]
    def series(name, s):  # sum_j f_j(s) v_j of each moving row; a part that is not there is zero.
        part = motion.get(name, {"functions": []})
        factors, sums = [function(f, s) for f in part["functions"]], [[0, 0, 0] for _ in rows]
        vectors, n, at = accessor(part["vectors"]) if "vectors" in part else [], len(factors), 0
        of_bodies = accessor(bodies[name]) if name in bodies else []
        def add(i, f, v):
            sums[i] = [x + f * y for x, y in zip(sums[i], v)]
        for j, f in enumerate(factors):
            for i in range(part["counts"][j] if "counts" in part else len(rows)):  # Function by function, or row by row.
                add(i, f, vectors[at + i] if "counts" in part else vectors[i * n + j])
            at += part["counts"][j] if "counts" in part else 0
            for i, (b, basis) in enumerate(based if of_bodies else []):
                for k, x in enumerate(basis if name == "position" else basis[:1]):  # The whole body turns as one.
                    add(i, f * x, of_bodies[(b * n + j) * 4 + k if name == "position" else b * n + j])
        return sums
    for row, now, then, turned, turned_then in zip(rows, *[series(k, x) for k in ("position", "rotation") for x in (s, middle)]):
        points[row] = [p + a - b for p, a, b in zip(points[row], now, then)]
        quats[row] = product(turn(turned), product(turn(turned_then, -1), quats[row]))
    return points, quats
if __name__ == "__main__":
    print(json.dumps(dict(zip(("positions", "rotations"), at(sys.argv[1], float(sys.argv[2]))))))
