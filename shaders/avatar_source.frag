#version 300 es
// Where each pixel of the person's figure is from, as renderer_read_source has it.
precision highp float;

in vec4 place;
in vec4 seen;

uniform vec4 kind;                 // x: the shown frame's time, seconds of the take
uniform highp sampler2D atlas_when; // hundredths of a second (high, low byte); blue: 1 if nobody saw it

out vec4 color;

#include "depth_agreement.glsl"

void main()
{
    float now = depth_agreement(seen);
    vec4 when = texture(atlas_when, place.xy);
    float then = floor(when.r * 255.0 + 0.5) * 256.0 + floor(when.g * 255.0 + 0.5);
    float age = min(abs(then - floor(kind.x * 100.0 + 0.5)), 65535.0);
    float what = now > 0.5 ? 85.0 : when.b > 0.5 ? 255.0 : 170.0;
    vec2 bytes = now > 0.5 ? vec2(0.0) : vec2(floor(age / 256.0), mod(age, 256.0));
    color = vec4(what / 255.0, bytes / 255.0, 1.0);
}
