"""Positions and orientations (x y z w) of the Gaussians of a gsburn .glb at a time: python3 read_motion.py scene.glb 0.5"""
import json, math, struct, sys
def read(path):
    data = open(path, "rb").read()
    length = struct.unpack_from("<I", data, 12)[0]
    doc, buffer = json.loads(data[20:20 + length]), data[28 + length:]
    def accessor(index):
        a = doc["accessors"][index]
        width, code = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[a["type"]], "I" if a["componentType"] == 5125 else "f"
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
    def series(name, s):  # sum_j f_j(s) v_j of each moving row; a part that is not there is zero.
        factors = [function(f, s) for f in motion.get(name, {"functions": []})["functions"]]
        vectors, n = accessor(motion[name]["vectors"]) if factors else [], len(factors)
        return [[sum(f * vectors[i * n + j][axis] for j, f in enumerate(factors)) for axis in range(3)] for i in range(len(rows))]
    for row, now, then, turned, turned_then in zip(rows, *[series(k, x) for k in ("position", "rotation") for x in (s, middle)]):
        points[row] = [p + a - b for p, a, b in zip(points[row], now, then)]
        quats[row] = product(turn(turned), product(turn(turned_then, -1), quats[row]))
    return points, quats
if __name__ == "__main__":
    print(json.dumps(dict(zip(("positions", "rotations"), at(sys.argv[1], float(sys.argv[2]))))))
