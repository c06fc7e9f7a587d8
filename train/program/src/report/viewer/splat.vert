#version 300 es
// One Gaussian as a quadrilateral: its motion, projection and colour, as the rasterizer of gsburn computes them.
precision highp sampler2D;

uniform sampler2D rows;      // three texels a Gaussian: mean and opacity logit; quaternion w x y z; log scales and motion row + 1
uniform sampler2D sh;        // one texel a coefficient
uniform sampler2D motion;    // per moving row its blocks, each of up to three texels: position; rotation; log scales and logit
uniform int degree;
uniform int texels;          // of a block
uniform int blocks;          // of a moving row
uniform int count;           // of blocks that have a weight now
uniform vec3 weights[64];    // block, its weight, the slope of that by time
uniform bool vectors;        // rotations are rotation vectors; otherwise differences of quaternions
uniform mat3 axes;           // of the camera, in the world: right, down, forward
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

vec4 texel(sampler2D from, int i) { return texelFetch(from, ivec2(i & 4095, i >> 12), 0); }
vec3 coefficient(int i) { return texel(sh, int(gaussian) * (degree + 1) * (degree + 1) + i).xyz; }
vec3 turned(vec4 q, vec3 v) { return v + 2. * cross(q.yzw, cross(q.yzw, v) + q.x * v); }
// Hamilton's product of quaternions w x y z.
vec4 product(vec4 a, vec4 b) { return vec4(a.x * b.x - dot(a.yzw, b.yzw), a.x * b.yzw + b.x * a.yzw + cross(a.yzw, b.yzw)); }

vec3 harmonics(vec3 d) {
  vec3 c = 0.5 + 0.28209479177387814 * coefficient(0);
  float x = d.x, y = d.y, z = d.z;
  if (degree > 0) c += 0.4886025119029199 * (-y * coefficient(1) + z * coefficient(2) - x * coefficient(3));
  if (degree > 1)
    c += 1.0925484305920792 * (x * y * coefficient(4) - y * z * coefficient(5) - x * z * coefficient(7))
      + 0.31539156525252005 * (2. * z * z - x * x - y * y) * coefficient(6)
      + 0.5462742152960396 * (x * x - y * y) * coefficient(8);
  if (degree > 2)
    c += -0.5900435899266435 * (y * (3. * x * x - y * y) * coefficient(9) + x * (x * x - 3. * y * y) * coefficient(15))
      + 2.890611442640554 * x * y * z * coefficient(10)
      - 0.4570457994644658 * (4. * z * z - x * x - y * y) * (y * coefficient(11) + x * coefficient(13))
      + 0.3731763325901154 * z * (2. * z * z - 3. * x * x - 3. * y * y) * coefficient(12)
      + 1.445305721320277 * z * (x * x - y * y) * coefficient(14);
  return max(c, 0.);
}

void main() {
  gl_Position = vec4(2., 2., 2., 1.);   // outside, until everything is known to be drawable
  int g = 3 * int(gaussian);
  vec4 mean = texel(rows, g), q = texel(rows, g + 1), shape = texel(rows, g + 2), turn = vec4(0.);
  vec3 velocity = vec3(0.);
  int moving = int(shape.w) - 1;
  shape.w = mean.w;                      // log scales and the opacity's logit
  for (int i = 0; moving >= 0 && i < count; i++) {
    int block = texels * (blocks * moving + int(weights[i].x));
    vec4 position = texel(motion, block);
    mean += weights[i].y * position;
    velocity += weights[i].z * position.xyz;
    if (texels > 1) turn += weights[i].y * texel(motion, block + 1);
    if (texels > 2) shape += weights[i].y * texel(motion, block + 2);
  }
  float angle = max(length(turn.xyz), 1e-8);
  q = normalize(vectors ? product(vec4(cos(0.5 * angle), sin(0.5 * angle) / angle * turn.xyz), q) : q + turn);
  vec3 p = (mean.xyz - eye) * axes;
  if (!(p.z >= range.x && p.z <= range.y)) return;

  // How the pixel moves with the world point, linearised inside the enlarged image, in units of the Gaussian's own axes.
  vec2 margin = @FRUSTUM_MARGIN@ * 0.5 * size / pinhole.xy;
  vec2 slope = clamp(p.xy / p.z, -pinhole.zw / pinhole.xy - margin, (size - pinhole.zw) / pinhole.xy + margin);
  vec2 focal = pinhole.xy / p.z;
  vec4 back = vec4(q.x, -q.yzw);
  vec3 m1 = exp(shape.xyz) * turned(back, focal.x * (axes[0] - slope.x * axes[2]));
  vec3 m2 = exp(shape.xyz) * turned(back, focal.y * (axes[1] - slope.y * axes[2]));
  float s11 = dot(m1, m1), s22 = dot(m2, m2), xy = dot(m1, m2), xx = s11 + eps2d, yy = s22 + eps2d;
  vec3 across = cross(m1, m2);
  float sharp = dot(across, across), det = sharp + eps2d * (s11 + s22) + eps2d * eps2d;
  float opacity = 1. / (1. + exp(-shape.w));
  if (antialiased) opacity *= sqrt(max(sharp / det, 1e-10));
  if (!(opacity >= ALPHA_MIN && det > 0. && xx < 1e12 && yy < 1e12)) return;

  centre = pinhole.xy * p.xy / p.z + pinhole.zw;
  conic = vec4(yy / det, -xy / yy, 1. / yy, opacity);
  color = fullSpeed > 0. ? 0.5 + 0.5 * clamp(velocity / fullSpeed, -1., 1.) : harmonics(normalize(mean.xyz - eye));

  // The quadrilateral along the ellipse's axes out to where alpha falls below ALPHA_MIN.
  float sigmas = sqrt(2. * log(opacity / ALPHA_MIN)) * 1.001;
  float middle = 0.5 * (xx + yy), radius = length(vec2(0.5 * (xx - yy), xy));
  vec2 axis = abs(xy) > 1e-6 * middle ? normalize(vec2(xy, middle + radius - xx)) : (xx >= yy ? vec2(1., 0.) : vec2(0., 1.));
  vec2 extent = sigmas * sqrt(vec2(middle + radius, max(middle - radius, eps2d))) + 0.01;
  vec2 corner = extent * (vec2(float(gl_VertexID & 1), float(gl_VertexID >> 1)) * 2. - 1.);
  vec2 at = centre + corner.x * axis + corner.y * vec2(-axis.y, axis.x);
  gl_Position = vec4(2. * at.x / size.x - 1., 1. - 2. * at.y / size.y, 0., 1.);
}
