#version 300 es
// The person's figure where the shown frame saw nothing of it, and the ribbon along its outline, which fades
// outwards: the colours gathered over the take.
precision highp float;

in vec4 place;
in vec3 lighting;

uniform highp sampler2D atlas; // colours in the mean light

out vec4 color; // premultiplied

void main()
{
    if (lighting.y > 0.5)
        discard;
    color = lighting.z * vec4(texture(atlas, place.xy).rgb * lighting.x, 1.0);
}
