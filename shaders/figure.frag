#version 300 es
// The person's figure: where the shown frame itself saw this place, squarely and
// near enough, its own colours; elsewhere those gathered over the take; and
// smoothly from the one to the other.
precision highp float;

in vec4 place;
in vec4 seen;
in vec2 lighting;

uniform highp sampler2D atlas;       // colours in the mean light
uniform highp sampler2D now_picture;
uniform highp sampler2D now_depth;   // millimetres (high, low byte); blue: 0 at the person's edge and elsewhere,
                                     // 1 well within

out vec4 color; // premultiplied

#include "left_by_room.glsl"

void main()
{
    vec3 own = texture(atlas, place.xy).rgb * lighting.x;
    vec4 there = texture(now_depth, seen.xy);
    float off = abs((there.r * 256.0 + there.g) * 0.255 - seen.z);
    float now = seen.w * there.b * (1.0 - smoothstep(0.05, 0.09, off));
    color = left_by_room() * vec4(mix(own, texture(now_picture, place.zw).rgb, now), 1.0);
}
