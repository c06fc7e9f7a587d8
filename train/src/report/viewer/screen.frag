#version 300 es
// A finished image: over the background, as a share of an exposure's light, or from that light to the screen.
precision highp float;
uniform sampler2D picture;
uniform vec3 background;
uniform int task;            // 0: to the screen; 1: decoded as light; 2: light to the screen
uniform bool linear;         // whether an exposure adds up light
uniform float share;
out vec4 pixel;

vec3 light(vec3 c) { return mix(pow((max(c, 0.04045) + 0.055) / 1.055, vec3(2.4)), c / 12.92, lessThanEqual(c, vec3(0.04045))); }
vec3 encoded(vec3 c) { return mix(1.055 * pow(max(c, 0.0031308), vec3(1. / 2.4)) - 0.055, 12.92 * c, lessThanEqual(c, vec3(0.0031308))); }

void main() {
  vec4 c = texelFetch(picture, ivec2(gl_FragCoord.xy), 0);
  vec3 over = task == 2 ? c.rgb : c.rgb + (1. - c.a) * background;
  if (linear && task == 1) over = light(over);
  if (linear && task == 2) over = encoded(over);
  pixel = task == 1 ? vec4(share * over, share) : vec4(over, 1.);
}
