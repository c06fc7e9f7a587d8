#version 300 es
// One Gaussian at one pixel: alpha as in the rasterizer's blend.
precision highp float;
uniform vec2 size;
flat in vec3 color;
flat in vec2 centre;
flat in vec4 conic;
out vec4 pixel;

void main() {
  vec2 d = vec2(gl_FragCoord.x, size.y - gl_FragCoord.y) - centre;
  float u = d.x + conic.y * d.y;
  float alpha = min(conic.w * exp(-0.5 * (conic.x * u * u + conic.z * d.y * d.y)), @ALPHA_MAX@);
  if (alpha < @ALPHA_MIN@) discard;
  pixel = vec4(alpha * color, alpha);
}
