#version 300 es
// The ribbon along the outline of the person's figure, which fades outwards: the colours gathered over the take, for
// what a frame itself saw at its outline is half the room.
precision highp float;

in vec4 place;
in vec2 lighting;

uniform highp sampler2D atlas; // colours in the mean light

out vec4 color; // premultiplied

void main()
{
    color = lighting.y * vec4(texture(atlas, place.xy).rgb * lighting.x, 1.0);
}
