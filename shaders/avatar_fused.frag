#version 300 es
// The person's figure in the colours gathered over the take: the triangles that have nothing of the shown frame's own,
// and the ribbon along the outline, which fades outwards, for what a frame itself saw at its outline is half the room.
precision highp float;

in vec4 place;
in vec2 lighting;

uniform highp sampler2D atlas; // colours in the mean light

out vec4 color; // premultiplied

#include "room_visibility.glsl"

void main()
{
    color = room_visibility() * lighting.y * vec4(texture(atlas, place.xy).rgb * lighting.x, 1.0);
}
