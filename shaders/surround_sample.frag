#version 300 es
// Every step_px.x-th pixel of the surface image, along both axes.
precision highp float;
precision highp int;

uniform highp sampler2D surface;
uniform vec4 step_px;

out vec4 color;

void main() { color = texelFetch(surface, ivec2(gl_FragCoord.xy) * int(step_px.x) + int(step_px.x) / 2, 0); }
