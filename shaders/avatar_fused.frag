#version 300 es
// Fragment of the avatar in fused colours only: triangles the shown frame did not see, and the silhouette ribbon, which
// fades outwards. (At its silhouette a frame's own pixels are half background.)
precision highp float;

in vec4 uv;
in vec2 lighting;

uniform highp sampler2D atlas; // fused colours under the mean light

out vec4 color; // premultiplied

#include "room_visibility.glsl"

void main()
{
    color = room_visibility() * lighting.y * vec4(texture(atlas, uv.xy).rgb * lighting.x, 1.0);
}
