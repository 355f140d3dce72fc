#version 300 es
// Fragment of the avatar: the shown frame's own colour where its depth agrees and it viewed the surface frontally, the
// fused texture elsewhere, blended smoothly.
precision highp float;

in vec4 uv;
in vec4 frame_sample;
in vec2 lighting;

uniform highp sampler2D atlas; // fused colours under the mean light
uniform highp sampler2D frame_color;

out vec4 color; // premultiplied

#include "depth_agreement.glsl"
#include "room_visibility.glsl"

void main()
{
    vec3 fused = texture(atlas, uv.xy).rgb * lighting.x;
    color = room_visibility() * vec4(mix(fused, texture(frame_color, uv.zw).rgb, depth_agreement(frame_sample)), 1.0);
}
