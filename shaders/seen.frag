#version 300 es
// Fragment of a point that is asked for: red is the share of it that is seen in the picture.
precision highp float;

in vec3 asked;

out vec4 color;

#include "picture_visibility.glsl"

void main()
{
    color = vec4(picture_visibility(asked.xy + 0.5, 0.5 * asked.z + 0.5), 0.0, 0.0, 1.0);
}
