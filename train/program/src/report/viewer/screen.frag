#version 300 es
// A finished image: as it is, decoded as light (of one instant of an exposure), or from that light to the screen.
precision highp float;
uniform highp sampler2D picture;
uniform int task;            // 0: as it is; 1: decode; 2: encode
out vec4 pixel;

vec3 light(vec3 c) { return mix(pow((max(c, 0.04045) + 0.055) / 1.055, vec3(2.4)), c / 12.92, lessThanEqual(c, vec3(0.04045))); }
vec3 encoded(vec3 c) { return mix(1.055 * pow(max(c, 0.0031308), vec3(1. / 2.4)) - 0.055, 12.92 * c, lessThanEqual(c, vec3(0.0031308))); }

void main() {
  vec3 c = texelFetch(picture, ivec2(gl_FragCoord.xy), 0).rgb;
  pixel = vec4(task == 1 ? light(c) : task == 2 ? encoded(c) : c, 1.);
}
