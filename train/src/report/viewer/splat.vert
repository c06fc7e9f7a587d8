#version 300 es
// One Gaussian as a quadrilateral: its motion, projection and colour, as the rasterizer of gsburn computes them.
precision highp float;
precision highp int;
precision highp isampler2D;

uniform sampler2D rows;      // three texels a Gaussian: mean and opacity logit; quaternion w x y z; log scales and motion row + 1
uniform isampler2D sh;       // one texel a coefficient, in units of shStep
uniform sampler2D motion;    // per moving row: position blocks, then rotation blocks, then shape blocks
uniform int degree;
uniform float shStep;
uniform ivec3 blocks;        // numbers of position, rotation and shape blocks of a moving row
uniform ivec3 counts;        // how many of each have a weight now
uniform ivec2 used[64];      // block of a position weight (x), block of a rotation or shape weight (y)
uniform vec3 weights[64];    // weight of position, its derivative by time, weight of rotation or shape
uniform bool turnsAreVectors; // rotation blocks are rotation vectors; otherwise differences of quaternions
uniform mat3 rotation;       // world to camera
uniform vec3 eye;
uniform vec4 pinhole;        // fx fy cx cy, pixels
uniform vec2 size;           // pixels
uniform vec2 range;          // near and far plane
uniform float eps2d;
uniform bool antialiased;
uniform float fullSpeed;     // above 0: colours show velocity instead

in uint gaussian;
flat out vec3 color;
flat out vec2 centre;
flat out vec4 conic;         // d1, shear, d2, opacity

const float ALPHA_MIN = @ALPHA_MIN@;
const float MARGIN = @FRUSTUM_MARGIN@;

vec4 texel(sampler2D from, int i) { return texelFetch(from, ivec2(i & 4095, i >> 12), 0); }
vec3 coefficient(int i) { return shStep * vec3(texelFetch(sh, ivec2(i & 4095, i >> 12), 0).xyz); }

// Hamilton's product of quaternions w x y z.
vec4 product(vec4 a, vec4 b) {
  return vec4(a.x * b.x - dot(a.yzw, b.yzw), a.x * b.yzw + b.x * a.yzw + cross(a.yzw, b.yzw));
}

mat3 matrix(vec4 q) {
  float w = q.x, x = q.y, y = q.z, z = q.w;
  return mat3(1. - 2. * (y * y + z * z), 2. * (x * y + w * z), 2. * (x * z - w * y),
              2. * (x * y - w * z), 1. - 2. * (x * x + z * z), 2. * (y * z + w * x),
              2. * (x * z + w * y), 2. * (y * z - w * x), 1. - 2. * (x * x + y * y));
}

vec3 harmonics(int first, vec3 d) {
  vec3 c = 0.5 + 0.28209479177387814 * coefficient(first);
  float x = d.x, y = d.y, z = d.z;
  if (degree > 0)
    c += 0.4886025119029199 * (-y * coefficient(first + 1) + z * coefficient(first + 2) - x * coefficient(first + 3));
  if (degree > 1)
    c += 1.0925484305920792 * (x * y * coefficient(first + 4) - y * z * coefficient(first + 5) - x * z * coefficient(first + 7))
      + 0.31539156525252005 * (2. * z * z - x * x - y * y) * coefficient(first + 6)
      + 0.5462742152960396 * (x * x - y * y) * coefficient(first + 8);
  if (degree > 2)
    c += -0.5900435899266435 * (y * (3. * x * x - y * y) * coefficient(first + 9) + x * (x * x - 3. * y * y) * coefficient(first + 15))
      + 2.890611442640554 * x * y * z * coefficient(first + 10)
      - 0.4570457994644658 * (4. * z * z - x * x - y * y) * (y * coefficient(first + 11) + x * coefficient(first + 13))
      + 0.3731763325901154 * z * (2. * z * z - 3. * x * x - 3. * y * y) * coefficient(first + 12)
      + 1.445305721320277 * z * (x * x - y * y) * coefficient(first + 14);
  return max(c, 0.);
}

void main() {
  gl_Position = vec4(2., 2., 2., 1.);   // outside, until everything is known to be drawable
  int g = int(gaussian);
  vec4 a = texel(rows, 3 * g), q = texel(rows, 3 * g + 1), c = texel(rows, 3 * g + 2);
  vec3 mean = a.xyz, velocity = vec3(0.), logScales = c.xyz;
  float logit = a.w;
  if (c.w > 0.) {
    int first = (int(c.w) - 1) * (blocks.x + blocks.y + blocks.z);
    for (int i = 0; i < counts.x; i++) {
      vec3 block = texel(motion, first + used[i].x).xyz;
      mean += weights[i].x * block;
      velocity += weights[i].y * block;
    }
    vec4 turn = vec4(0.), shape = vec4(0.);
    for (int i = 0; i < counts.y; i++) turn += weights[i].z * texel(motion, first + blocks.x + used[i].y);
    for (int i = 0; i < counts.z; i++) shape += weights[i].z * texel(motion, first + blocks.x + blocks.y + used[i].y);
    if (turnsAreVectors) {
      float angle = max(length(turn.xyz), 1e-8);
      q = product(vec4(cos(0.5 * angle), sin(0.5 * angle) / angle * turn.xyz), q);
    } else q += turn;
    logScales += shape.xyz;
    logit += shape.w;
  }
  vec3 p = rotation * (mean - eye);
  if (!(p.z >= range.x && p.z <= range.y)) return;

  // J W: how the pixel moves with the world point, linearised inside the enlarged image.
  vec2 margin = MARGIN * 0.5 * size / pinhole.xy;
  vec2 slope = clamp(p.xy / p.z, -pinhole.zw / pinhole.xy - margin, (size - pinhole.zw) / pinhole.xy + margin);
  vec2 focal = pinhole.xy / p.z;
  mat3 byRow = transpose(rotation);
  vec3 j1 = focal.x * (byRow[0] - slope.x * byRow[2]), j2 = focal.y * (byRow[1] - slope.y * byRow[2]);
  mat3 axes = matrix(normalize(q));
  vec3 scales = exp(logScales);
  vec3 m1 = scales * (j1 * axes), m2 = scales * (j2 * axes);
  float s11 = dot(m1, m1), s22 = dot(m2, m2), xy = dot(m1, m2);
  float xx = s11 + eps2d, yy = s22 + eps2d;
  vec3 across = cross(m1, m2);
  float sharp = dot(across, across), det = sharp + eps2d * (s11 + s22) + eps2d * eps2d;
  float opacity = 1. / (1. + exp(-logit));
  if (antialiased) opacity *= sqrt(max(sharp / det, 1e-10));
  if (!(opacity >= ALPHA_MIN && det > 0. && xx < 1e12 && yy < 1e12)) return;

  centre = pinhole.xy * p.xy / p.z + pinhole.zw;
  conic = vec4(yy / det, -xy / yy, 1. / yy, opacity);
  color = fullSpeed > 0. ? 0.5 + 0.5 * clamp(velocity / fullSpeed, -1., 1.) : harmonics(g * (degree + 1) * (degree + 1), normalize(mean - eye));

  // The quadrilateral along the ellipse's axes out to where alpha falls below ALPHA_MIN.
  float sigmas = sqrt(2. * log(opacity / ALPHA_MIN)) * 1.001;
  float middle = 0.5 * (xx + yy), radius = length(vec2(0.5 * (xx - yy), xy));
  vec2 axis = abs(xy) > 1e-6 * middle ? normalize(vec2(xy, middle + radius - xx)) : (xx >= yy ? vec2(1., 0.) : vec2(0., 1.));
  vec2 extent = sigmas * sqrt(vec2(middle + radius, max(middle - radius, eps2d))) + 0.01;
  vec2 corner = vec2(float(gl_VertexID & 1), float(gl_VertexID >> 1)) * 2. - 1.;
  vec2 at = centre + corner.x * extent.x * axis + corner.y * extent.y * vec2(-axis.y, axis.x);
  gl_Position = vec4(2. * at.x / size.x - 1., 1. - 2. * at.y / size.y, 0., 1.);
}
