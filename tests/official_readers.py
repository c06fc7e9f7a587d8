"""Files that gsburn writes, read by the official readers, and theirs read by gsburn.

    python3 -m venv tools && tools/bin/pip install usd-core trimesh && npm --prefix tools install @playcanvas/splat-transform
    tools/bin/python tests/official_readers.py target/release/gsburn tools/node_modules/.bin/splat-transform

Outside the default tests, because it installs programs. What is not installed is named and left out.
"""
import math, os, random, struct, subprocess, sys, tempfile

COUNT, DEGREE = 700, 3
REST = 3 * ((DEGREE + 1) ** 2 - 1)
NAMES = (["x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2"] + [f"f_rest_{k}" for k in range(REST)]
         + ["opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"])


def write_ply(path):
    rng = random.Random(5)
    u = lambda a, b: rng.uniform(a, b)
    with open(path, "wb") as file:
        header = "".join(f"property float {name}\n" for name in NAMES)
        file.write(f"ply\nformat binary_little_endian 1.0\nelement vertex {COUNT}\n{header}end_header\n".encode())
        for _ in range(COUNT):
            q = [u(-1, 1) for _ in range(4)]
            norm = math.sqrt(sum(x * x for x in q))
            row = ([u(-3, 3) for _ in range(3)] + [0, 0, 0] + [u(-1.5, 1.5) for _ in range(3)]
                   + [u(-0.5, 0.5) for _ in range(REST)] + [u(-4, 4)] + [u(-6, -1) for _ in range(3)] + [x / norm for x in q])
            file.write(struct.pack(f"<{len(row)}f", *row))


def read_ply(path):
    data = open(path, "rb").read()
    end = data.index(b"end_header\n") + 11
    lines = data[:end].decode().splitlines()
    count = next(int(line.split()[2]) for line in lines if line.startswith("element vertex"))
    names = [line.split()[2] for line in lines if line.startswith("property float")]
    rows = struct.iter_unpack(f"<{len(names)}f", data[end:end + 4 * len(names) * count])
    return [dict(zip(names, row)) for row in rows]



def nearest(rows, others):
    """Each row with the row of others nearest to it."""
    return [(row, min(others, key=lambda o: sum((row[a] - o[a]) ** 2 for a in "xyz"))) for row in rows]


def axes(row):
    """The Gaussian's own axes in the world; an axis and its opposite are one shape."""
    w, x, y, z = (row[f"rot_{k}"] for k in range(4))
    n = w * w + x * x + y * y + z * z
    matrix = [[w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)],
              [2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)],
              [2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z]]
    return [[matrix[i][k] / n for i in range(3)] for k in range(3)]


def apart(a, b):
    """The largest angle between axes of two Gaussians."""
    dots = [abs(sum(p * q for p, q in zip(u, v))) for u, v in zip(axes(a), axes(b))]
    return math.acos(min(1, min(dots)))


def half_turn_about_y(rows):
    """splat-transform turns a PLY about z to have y up, gsburn about x: both are upright and face opposite ways."""
    signs = [1, -1, -1, -1, -1, 1, 1, 1, 1, 1, 1, -1, -1, -1, -1]
    turned = []
    for row in rows:
        w, x, y, z = (row[f"rot_{k}"] for k in range(4))
        new = dict(row, x=-row["x"], z=-row["z"], rot_0=-y, rot_1=z, rot_2=w, rot_3=-x)
        new.update({f"f_rest_{k}": signs[k % 15] * row[f"f_rest_{k}"] for k in range(REST)})
        turned.append(new)
    return turned


def compare(what, rows, others, bounds):
    assert len(rows) == len(others), f"{what}: {len(rows)} and {len(others)} Gaussians"
    worst = {}
    for a, b in nearest(rows, others):
        sigmoid = lambda x: 1 / (1 + math.exp(-x))
        found = {
            "position": max(abs(a[k] - b[k]) for k in "xyz"),
            "opacity": abs(sigmoid(a["opacity"]) - sigmoid(b["opacity"])),
            "scale": max(abs(a[f"scale_{k}"] - b[f"scale_{k}"]) for k in range(3)),
            "rotation": apart(a, b),
            "colour": max(abs(a[f"f_dc_{k}"] - b[f"f_dc_{k}"]) for k in range(3)),
            "harmonics": max([abs(a[f"f_rest_{k}"] - b[f"f_rest_{k}"]) for k in range(REST)] or [0]),
        }
        worst = {key: max(worst.get(key, 0), value) for key, value in found.items()}
    print(f"{what}: " + ", ".join(f"{key} {value:.2g}" for key, value in worst.items()))
    for key, bound in bounds.items():
        assert worst[key] <= bound, f"{what}: {key} differs by {worst[key]}, expected at most {bound}"


# Half a step of each quantisation of SPZ, as in datasets/splats/src/spz/tests.rs; a rotation of three components off by half of 1/(511 sqrt 2).
SPZ = {"position": 0.00013, "opacity": 0.0021, "scale": 0.0313, "rotation": 0.006, "colour": 0.0132, "harmonics": 0.067}
EXACT = {"position": 1e-6, "opacity": 1e-6, "scale": 1e-5, "rotation": 1e-3, "colour": 1e-6, "harmonics": 1e-6}
# 11 and 10 bits between the ends of a chunk that may span the scene, 8 bits of colour over 8 / 256 of harmonics.
PACKED = {"position": 0.005, "opacity": 0.0041, "scale": 0.005, "rotation": 0.01, "colour": 0.04, "harmonics": 0.017}


def points_of_gltf(scene, path):
    """A reader of glTF that does not know the extension of Gaussians sees their middles as points."""
    try:
        import trimesh
    except ImportError:
        print("trimesh is not installed")
        return
    (points,) = trimesh.load(path).geometry.values()
    assert len(points.vertices) == COUNT, f"{len(points.vertices)} points"
    for row, (x, y, z) in zip(scene, points.vertices):
        assert max(abs(row["x"] - x), abs(row["y"] + y), abs(row["z"] + z)) < 1e-6, "y is up"
    print(f"our glTF, read by trimesh {trimesh.__version__}: {COUNT} points")


def main(gsburn, transform):
    folder = tempfile.mkdtemp()
    at = lambda name: os.path.join(folder, name)
    run = lambda *args: subprocess.run(args, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    write_ply(at("scene.ply"))
    scene = read_ply(at("scene.ply"))
    for name in ("scene.spz", "scene.glb", "scene.usda"):
        run(gsburn, "convert", at("scene.ply"), at(name))
    if os.path.exists(transform):
        run(transform, "-w", at("scene.spz"), at("theirs.ply"))
        compare("our SPZ, read by splat-transform", scene, read_ply(at("theirs.ply")), SPZ)
        run(transform, "-w", at("scene.ply"), at("packed.compressed.ply"))
        run(gsburn, "convert", at("packed.compressed.ply"), at("unpacked.ply"))
        compare("their compressed PLY, read by gsburn", scene, read_ply(at("unpacked.ply")), PACKED)
        if subprocess.run([transform, "-w", at("scene.ply"), at("theirs.glb")], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL).returncode == 0:
            run(gsburn, "convert", at("theirs.glb"), at("from.ply"))
            compare("their glTF, read by gsburn", half_turn_about_y(scene), read_ply(at("from.ply")), EXACT)
    else:
        print(f"splat-transform: {transform} is not there")
    points_of_gltf(scene, at("scene.glb"))
    try:
        from pxr import Usd
    except ImportError:
        print("usd-core is not installed")
        return
    stage = Usd.Stage.Open(at("scene.usda"))
    prim = stage.GetDefaultPrim().GetChild("Splats")
    assert prim.GetTypeName() == "ParticleField3DGaussianSplat" and prim.IsDefined()
    get = lambda name: prim.GetAttribute(name).Get()
    known = set(Usd.SchemaRegistry().FindConcretePrimDefinition(prim.GetTypeName()).GetPropertyNames())
    unknown = [a.GetName() for a in prim.GetAuthoredAttributes() if a.GetName() not in known]
    assert not unknown, f"attributes that the schema does not know: {unknown}"
    positions, turns, degree = get("positions"), get("orientations"), get("radiance:sphericalHarmonicsDegree")
    harmonics = get("radiance:sphericalHarmonicsCoefficients")
    assert (len(positions), len(turns), degree) == (COUNT, COUNT, DEGREE) and len(harmonics) == COUNT * (DEGREE + 1) ** 2
    for row, place, turn in zip(scene, positions, turns):
        assert max(abs(row["x"] - place[0]), abs(row["y"] + place[1]), abs(row["z"] + place[2])) < 1e-6, "y is up"
        assert abs(row["rot_0"] - turn.GetReal()) < 1e-6 and abs(row["rot_1"] - turn.GetImaginary()[0]) < 1e-6
    print(f"our OpenUSD, read by usd-core {'.'.join(map(str, Usd.GetVersion()[1:]))}: {COUNT} Gaussians of degree {degree}")
    if len(sys.argv) > 3:
        moving = Usd.Stage.Open(sys.argv[3]).GetDefaultPrim().GetChild("Splats").GetAttribute("positions")
        print(f"{sys.argv[3]}: {moving.GetNumTimeSamples()} samples, at frame 0.5 {moving.Get(0.5)[0]}")


main(*sys.argv[1:3])
