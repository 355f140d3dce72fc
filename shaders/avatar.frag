#version 300 es
// The person's figure: where the shown frame itself saw this place, squarely and
// near enough, its own colours; elsewhere those gathered over the take; and
// smoothly from the one to the other.
precision highp float;

in vec4 place;
in vec4 seen;
in vec2 lighting;

uniform highp sampler2D atlas;       // colours in the mean light
uniform highp sampler2D frame_color;

out vec4 color; // premultiplied

#include "depth_agreement.glsl"
#include "room_visibility.glsl"

void main()
{
    vec3 own = texture(atlas, place.xy).rgb * lighting.x;
    color = room_visibility() * vec4(mix(own, texture(frame_color, place.zw).rgb, depth_agreement(seen)), 1.0);
}
